"""Single numbers changed anywhere in a certificate are found by mathematics, not by the digest."""

from itertools import cycle, product

import numpy as np
import pytest

from helpers.certificates import failures, made, without_loop

SEED = 20261124
CORRUPTIONS = {True: 50, False: 25}
"""Of each of two designs, in rational and in floating point arithmetic."""
KINDS = {
    "baxter": {"D", "F", "W", "delay"},
    "moving": {"D", "F", "W", "delay", "shared delay", "shared W", "window"},
}
"""What of each design has to be among the changed numbers."""


def inequalities_hold(data):
    """Whether all matrix inequalities of a certificate hold, by NumPy alone."""
    D = np.diag(data["D_theta"])

    def holds(factor, W, F, d):
        W, F = np.array(W), np.array(F)
        block = np.block([[factor * D - W, d * F], [d * F.T, W]])
        return bool((W == W.T).all()) and np.linalg.eigvalsh(block)[0] > 0.0

    common, moving = data["common_multiplier"], data["time_varying_multiplier"]
    good = all(holds(2.0, p["W"][0], p["F"], p["delay_s"]) for p in data["proofs"])
    if common is not None:
        d = data["common_multiplier_delay_s"]
        good &= all(holds(2.0, common, p["F"], d) for p in data["proofs"])
    for window in data["time_varying_windows"]:
        factor = (np.sqrt(2.0) - window["radius"]) ** 2
        for signs in product((-1.0, 1.0), repeat=len(window["axes"])):
            F = window["centre"] + sum(s * np.array(a) for s, a in zip(signs, window["axes"]))
            good &= holds(factor, moving, F, data["time_varying_delay_s"])
    return good


def numbers(data):
    """Holder and key of every number that a matrix inequality is made of."""
    for proof in data["proofs"]:
        yield "delay", proof, "delay_s"
        yield from entries("F", proof["F"])
        yield from entries("W", proof["W"])
    for key in ("common_multiplier", "time_varying"):
        if data[f"{key}_delay_s"] is not None:
            yield "shared delay", data, f"{key}_delay_s"
            yield from entries("shared W", data[f"{key.removesuffix('_multiplier')}_multiplier"])
    for window in data["time_varying_windows"]:
        yield "radius", window, "radius"
        yield from entries("window", window["centre"])
        yield from entries("window", window["axes"])
    yield from entries("D", data["D_theta"])


def entries(name, values):
    for at, value in enumerate(values):
        if isinstance(value, list):
            yield from entries(name, value)
        else:
            yield name, values, at


def corrupted(data, some, rng):
    """Change one number by 0.1 % to tenfold so that an inequality is false; None if none is."""
    for _ in range(100):
        _, holder, key = some[rng.integers(len(some))]
        before = holder[key]
        holder[key] = before * (1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-3, 1))
        if not inequalities_hold(data):
            return holder, key, before
        holder[key] = before
    return None


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("design", ["baxter", "moving"])
def test_a_hundred_numbers_that_break_an_inequality_are_found(design, exact):
    rng = np.random.default_rng(SEED)
    data = without_loop(made(design))
    assert inequalities_hold(data)
    assert failures(data, exact=exact) == []
    places, found, missed = list(numbers(data)), [], []
    for kind in cycle(sorted({place[0] for place in places})):
        one = corrupted(data, [place for place in places if place[0] == kind], rng)
        if one is not None:
            holder, key, before = one
            (found if failures(data, exact=exact) else missed).append(kind)
            holder[key] = before
        if len(found) + len(missed) == CORRUPTIONS[exact]:
            break
    assert missed == []
    assert set(found) >= KINDS[design]


@pytest.mark.parametrize("design", ["baxter", "moving", "crawl"])
@pytest.mark.parametrize("key", ["J_star", "stiffness", "F", "W", "Q", "spring", "damping"])
def test_numbers_that_only_fix_each_other_are_found(design, key):
    """J*, S, K and D_θ: also where the changed design would still be passive."""
    rng = np.random.default_rng(SEED)
    data = made(design)
    proofs = data["proofs"]
    for trial in range(4):
        if key in ("spring", "damping"):
            holder = data["spring_stiffness" if key == "spring" else "D_theta"]
            at = int(rng.integers(len(holder)))
        else:
            matrix = proofs[trial % len(proofs)][key]
            matrix = matrix[0] if key in ("W", "Q") else matrix
            large = np.argwhere(np.abs(matrix) > 0.05 * np.abs(matrix).max())
            row, at = (int(k) for k in large[rng.integers(len(large))])
            holder = matrix[row]
        before = holder[at]
        holder[at] = before * (1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-3, 1))
        assert failures(data), (key, at, before, holder[at])
        holder[at] = before


def test_an_unchanged_certificate_is_not_accused():
    for design, exact in product(("baxter", "moving", "crawl"), (False, True)):
        assert failures(made(design), exact=exact) == []


@pytest.mark.parametrize("design", ["baxter", "moving", "crawl"])
def test_a_delay_beyond_the_supremum_cannot_be_proven(design):
    """Scaling W with the delay, as a clever forger would, does not help."""
    for factor in (1.00001, 1.01, 2.0):
        data = made(design)
        proof, longer = data["proofs"][0], data["max_delay_s"] * factor
        data["max_delay_s"] = data["bounds_s"][proof["instant"]] = proof["delay_s"] = longer
        proof["W"] = [(factor * np.array(block)).tolist() for block in proof["W"]]
        data["max_delay_upper_s"] *= factor
        for exact in (False, True):
            assert f"instant {proof['instant']}: matrix inequality" in failures(data, exact=exact)
