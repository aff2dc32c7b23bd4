"""Proofs of the jitter margin: what holds is proven in rationals, what is longer is not."""

from dataclasses import replace

import numpy as np
import pytest

from sealag.errors import InputError
from sealag.margin import DelayedLoop
from sealag.passivity import LocalLoop, Place


def plant(seed, *, embedded=False, free=False):
    """Springs, motors and a late command of two joints; late torque feedback; a free motion."""
    rng = np.random.default_rng(seed)
    n, none, one = 2, np.zeros((2, 2)), np.eye(2)
    X = rng.normal(size=(n, n))
    M = np.linalg.inv(X @ X.T + 0.3 * one)
    K, rotor, D = rng.uniform(50, 500, n), rng.uniform(0.05, 0.3, n), rng.uniform(3, 30, n)
    A_0 = np.block(
        [
            [none, none, one, none],
            [none, none, none, one],
            [-M @ np.diag(K + 20.0), M @ np.diag(K), -M, none],
            [np.diag(K / rotor), -np.diag(K / rotor), none, -np.diag(D / rotor)],
        ]
    )
    B = np.vstack([none, none, none, np.diag(1.0 / rotor)])
    Y = rng.normal(size=(n, n))
    C = np.hstack([none, -30.0 * Y @ Y.T - one + rng.normal(size=(n, n)), none, -0.3 * one])
    A_e = 0.2 * B @ np.hstack([np.diag(K), -np.diag(K), none, none]) if embedded else 0.0 * A_0
    V = np.zeros((8, 0))
    if free:
        A_0, A_e = (np.pad(A, ((0, 2), (0, 2))) for A in (A_0, A_e))
        A_0[8, 9] = 1.0
        B, C, V = np.pad(B, ((0, 2), (0, 0))), np.pad(C, ((0, 0), (0, 2))), np.eye(10)[:, 8:9]
    return A_0, B, C, A_e, V


def stated(A_0, B, C, A_e, V, *, e):
    names = [f"x{k}" for k in range(8)] + ["z", "d/dt z"][: len(A_0) - 8]
    return LocalLoop(
        states=tuple(names), A_0=A_0, A_1=B @ C, A_e=A_e if A_e.any() else None,
        embedded_delay_s=e, symmetries=V, at=Place.POSTURE, frequency_rad_s=None,
    )  # fmt: skip


def multipliers(loop, B, C):
    without = loop.without_symmetries()
    A_0, _, A_e = without.doubles()
    B, C = without.sides(B, C)
    e = loop.embedded_delay_s
    found = DelayedLoop(A_0, B, C, A_e=A_e if e else None, embedded_delay=e)
    return found.jitter_multipliers(*without.rows), found.jitter_margin()


CASES = [(seed, embedded, free) for seed in (0, 1, 4) for embedded in (0, 1) for free in (0, 1)]


@pytest.mark.parametrize(("seed", "embedded", "free"), CASES)
def test_the_margin_is_proven_and_a_longer_one_is_not(seed, embedded, free):
    e = 0.004 if embedded else 0.0
    parts = plant(seed, embedded=embedded, free=free)
    loop = stated(*parts, e=e)
    found, margin = multipliers(loop, *parts[1:3])
    room = 1e-4 if np.isfinite(margin.frequency) else 2e-2  # at its peak I − DᵀD is singular
    assert margin.delay * (1.0 - room) < found.delay <= margin.delay * (1.0 + 1e-6)
    assert margin.neutral == 0  # divided out in rationals
    assert len(found.P) == 8
    given = {"P": found.P, "X": found.X, "X_e": found.X_e}
    held = loop.proven(found.delay, **given)
    assert held.jitter.delay_s == found.delay
    without = loop.without_symmetries()
    assert held.jitter.check(without, e, exact=True).ok
    for factor in (1.0 + 1e-4, 1.1, 100.0):
        assert loop.proven(found.delay * factor, **given) is None
        longer = replace(held.jitter, delay_s=found.delay * factor)
        assert not longer.check(without, e, exact=True).ok
    assert loop.proven(found.delay, **{**given, "P": -found.P}) is None
    assert loop.proven(found.delay, **{**given, "P": 1.001 * found.P}) is None
    assert loop.proven(found.delay, **{**given, "X": found.X[:1]}) is None
    if embedded:
        assert not held.jitter.check(without, 1.001 * e, exact=False).ok


def test_it_is_the_inequality_that_is_decided():
    """Eigenvalues of [[P A + Aᵀ P, P L], [⋆, −X]] + [R A, R L]ᵀ b X b [R A, R L] by NumPy."""
    A_0, B, C, A_e, V = plant(5, embedded=True)
    loop = stated(A_0, B, C, A_e, V, e=0.004)
    found, _ = multipliers(loop, B, C)
    L = np.eye(8)[:, [6, 7, 6, 7]]
    A, R = A_0 + B @ C + A_e, np.vstack([(B @ C)[6:], A_e[6:]])
    X = np.zeros((4, 4))
    X[:2, :2], X[2:, 2:] = found.X, found.X_e

    def largest(d):
        b, K = np.diag([d, d, 0.004, 0.004]), np.hstack([A, L])
        P = found.P
        whole = np.block([[P @ A + A.T @ P, P @ L], [L.T @ P, -X]])
        whole += (R @ K).T @ b @ X @ b @ R @ K
        scale = 1.0 / np.sqrt(np.abs(np.diagonal(whole)))
        return np.linalg.eigvalsh(whole * np.outer(scale, scale))[-1]

    assert largest(0.99 * found.delay) < 0.0 < largest(1.01 * found.delay)


def test_what_is_unstable_or_not_late_has_no_multipliers():
    rows = [False, True]
    late = ([[0.0], [10.0]], [[-100.0, 0.0]])
    assert DelayedLoop([[0.0, 1.0], [0.0, 10.0]], *late).jitter_multipliers(rows) is None
    assert DelayedLoop([[0.0, 1.0], [0.0, -10.0]], *late).jitter_multipliers([False, True])
    assert DelayedLoop([[-1.0]], [[1.0]], [[0.0]]).jitter_multipliers([False]) is None


def test_symmetries_have_to_be_divided_out_before():
    A_0, B, C, _, V = plant(0, free=True)
    with pytest.raises(InputError, match="divide them out"):
        DelayedLoop(A_0, B, C, symmetries=V).jitter_multipliers((B @ C).any(axis=1))
