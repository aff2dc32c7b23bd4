"""The jitter margin: closed forms, brute force over frequencies, delays that vary as they like."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from sealag.errors import InputError, SolverError
from sealag.margin import DelayedLoop


def joint(B, D, k):
    """B θ̈ + D θ̇ + k θ(t − τ) = 0."""
    return [[0.0, 1.0], [0.0, -D / B]], [[0.0], [1.0 / B]], [[-k, 0.0]]


def plant(rng, *, law):
    """Links, springs and motors of 1 to 3 joints, A_0, B, C, and F where C = −F."""
    n = int(rng.integers(1, 4))
    X = rng.normal(size=(n, n))
    M, one, none = np.linalg.inv(X @ X.T + 0.3 * np.eye(n)), np.eye(n), np.zeros((n, n))
    K, rotor, D = rng.uniform(50, 500, n), rng.uniform(0.05, 0.3, n), rng.uniform(3, 30, n)
    A_0 = np.block(
        [
            [none, none, one, none],
            [none, none, none, one],
            [-M @ np.diag(K + 20.0), M @ np.diag(K), -M * rng.uniform(0.1, 1.0), none],
            [np.diag(K / rotor), -np.diag(K / rotor), none, -np.diag(D / rotor)],
        ]
    )
    B = np.vstack([none, none, none, np.diag(1.0 / rotor)])
    Y = rng.normal(size=(n, n))
    F = 30.0 * Y @ Y.T + 1.0 * one
    rates = np.diag(rng.uniform(0.1, 2.0, n))
    C = {
        "stiffness": np.hstack([none, -F, none, none]),
        "asymmetric": np.hstack([none, -F - 5.0 * rng.normal(size=(n, n)), none, none]),
        "pd": np.hstack([none, -F, none, -rates]),
        "links": np.hstack([-0.2 * F, none, none, none]),
    }[law]
    return A_0, B, C, 1.0 / np.linalg.norm(F / np.sqrt(np.outer(D, D)), 2)


def gain(A_0, B, C, *, A_e=0.0, radius=False):
    """Largest norm, or spectral radius, of s R (s − A)⁻¹ B L over frequencies, by brute force."""
    A = A_0 + B @ C + A_e
    U, values, V = np.linalg.svd(C, full_matrices=False)
    kept = values > 1e-12 * values[0]
    L, R = U[:, kept] * np.sqrt(values[kept]), np.sqrt(values[kept])[:, None] * V[kept]
    frequencies = np.concatenate([np.geomspace(1e-2, 1e5, 4000), np.abs(np.linalg.eigvals(A))])
    T = [1j * w * R @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B @ L) for w in frequencies]
    if radius:
        return max(np.abs(np.linalg.eigvals(one)).max() for one in T)
    return max(np.linalg.norm(one, 2) for one in T)


def run(A_0, B, C, delay, *, step, time, A_e=None, late=None):
    """|x| over time with a delay τ(t, x, past) of whole steps; the state is exact between them."""
    N, r = B.shape
    block = np.zeros((N + r + N, N + r + N))
    block[:N, :N], block[:N, N : N + r], block[:N, N + r :] = A_0, B, np.eye(N)
    phi = expm(block * step)[:N]
    x, sizes = np.ones(N), []
    past = [x] * 20000
    for k in range(round(time / step)):
        steps = delay(k * step, past)
        shift = np.zeros(N) if A_e is None else A_e @ past[-1 - late(k * step, past)]
        x = phi @ np.concatenate([x, C @ past[-1 - steps], shift])
        past.append(x)
        sizes.append(float(np.linalg.norm(x)))
    return np.array(sizes)


def delays(bound, step, A_0, B, C):
    """Delays up to a bound: sawtooth, bang-bang, and greedy, which takes the command out of the
    past that does most work against the loop."""
    most = int(bound / step)
    A = A_0 + B @ C
    P = np.eye(len(A))
    for _ in range(3):  # a metric in which the loop decays
        P = P + sum(expm(A.T * t) @ expm(A * t) for t in np.linspace(0.0, 2.0, 40))

    def greedy(t, past):
        pushes = [
            past[-1] @ P @ B @ C @ past[-1 - s] for s in range(0, most + 1, max(1, most // 8))
        ]
        return int(np.argmax(pushes)) * max(1, most // 8)

    return {
        "longest": lambda t, past: most,
        "sawtooth": lambda t, past: round(t / step) % (most + 1),
        "bang-bang": lambda t, past: most * ((round(t / step) // (3 * most // 2 + 1)) % 2),
        "greedy": greedy,
    }


def test_one_joint_has_the_passive_bound():
    """T = k s/(B s² + D s + k) peaks at D/k⁻¹: the margin is D/k, as Theorem 1 says."""
    found = DelayedLoop(*joint(0.1, 10.0, 100.0)).jitter_margin()
    assert found.delay == pytest.approx(0.1, rel=2e-9)
    assert found.delay <= 0.1 <= found.upper * (1.0 + 1e-9)
    assert found.frequency == pytest.approx(math.sqrt(100.0 / 0.1), rel=1e-3)


def test_one_integrator_has_its_peak_above_all_roots():
    """ẋ = −k x(t − τ): T = k s/(s + k), so that d = 1/k; a constant delay may be π/2k."""
    found = DelayedLoop([[0.0]], [[1.0]], [[-4.0]]).jitter_margin()
    assert found.delay == pytest.approx(0.25, rel=2e-9)
    assert found.frequency == math.inf
    assert DelayedLoop([[0.0]], [[-4.0]]).margin().delay == pytest.approx(math.pi / 8)


@pytest.mark.parametrize("law", ["stiffness", "asymmetric", "pd", "links"])
def test_it_is_the_largest_gain_over_all_frequencies(law):
    rng = np.random.default_rng(3)
    for _ in range(10):
        A_0, B, C, _ = plant(rng, law=law)
        found = DelayedLoop(A_0, B, C).jitter_margin()
        if found.unstable_roots:
            assert np.linalg.eigvals(A_0 + B @ C).real.max() > -1e-9
            continue
        reached = gain(A_0, B, C)
        assert found.delay * reached <= 1.0
        assert found.delay * reached == pytest.approx(1.0, rel=1e-3)
        assert found.upper * gain(A_0, B, C, radius=True) >= 1.0 - 1e-3


@pytest.mark.parametrize("law", ["stiffness", "asymmetric", "pd", "links"])
def test_it_lies_between_the_passive_bound_and_the_constant_margin(law):
    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(60):
        A_0, B, C, passive = plant(rng, law=law)
        found = DelayedLoop(A_0, B, C).jitter_margin()
        constant = DelayedLoop(A_0, B @ C).margin()
        assert found.unstable_roots == constant.unstable_roots
        if found.unstable_roots:
            assert found.delay == 0.0
            continue
        compared += 1
        assert 0.0 < found.delay <= min(constant.delay, found.upper)
        if law == "stiffness":
            assert passive <= found.delay * (1.0 + 1e-8)
    assert compared > 30


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["longest", "sawtooth", "bang-bang", "greedy"])
def test_no_delay_below_it_makes_the_loop_grow(seed, kind):
    A_0, B, C, _ = plant(np.random.default_rng(seed), law="stiffness")
    found, slowest = (
        DelayedLoop(A_0, B, C).jitter_margin(),
        -np.linalg.eigvals(A_0 + B @ C).real.max(),
    )
    step = found.delay / 60.0
    delay = delays(0.99 * found.delay, step, A_0, B, C)[kind]
    sizes = run(A_0, B, C, delay, step=step, time=min(12.0 / slowest, 4000 * step))
    assert sizes[-200:].max() < 0.9 * sizes[: len(sizes) // 4].max()


def test_one_and_a_half_times_the_constant_margin_grows():
    """Negative control of the simulation."""
    A_0, B, C, _ = plant(np.random.default_rng(0), law="stiffness")
    step = DelayedLoop(A_0, B @ C).margin().delay / 60.0
    sizes = run(A_0, B, C, lambda t, past: 90, step=step, time=6000 * step)
    assert sizes[-200:].max() > 10.0 * sizes[:1000].max()


class TestEmbedded:
    """Torque feedback that is late in the drives: a second delay with a multiplier of its own."""

    def loop(self):
        A_0, B, C = (np.array(part) for part in joint(0.1, 10.0, 100.0))
        return A_0, B, C, np.array([[0.0, 0.0], [-300.0, 0.0]])

    def test_it_costs_and_vanishes_with_its_delay(self):
        A_0, B, C, A_e = self.loop()
        without = DelayedLoop(A_0 + A_e, B, C).jitter_margin()
        assert (
            DelayedLoop(A_0, B, C, A_e=A_e, embedded_delay=0.0).jitter_margin().delay
            == without.delay
        )
        found = [
            DelayedLoop(A_0, B, C, A_e=A_e, embedded_delay=e).jitter_margin().delay
            for e in (1e-6, 0.005, 0.01)
        ]
        assert found[0] == pytest.approx(without.delay, rel=1e-3)
        assert without.delay >= found[0] > found[1] > found[2] > 0.0

    def test_the_best_weight_is_found(self):
        """d² |T_1|² < x … over a fine grid of weights and frequencies, by brute force."""
        A_0, B, C, A_e = self.loop()
        e, A = 0.01, A_0 + B @ C + A_e
        R = np.array([[math.sqrt(100.0), 0.0], [math.sqrt(300.0), 0.0]])
        L = np.array([[0.0, 0.0], [-math.sqrt(100.0) / 0.1, -math.sqrt(300.0)]])
        frequencies, best = np.geomspace(1, 1e4, 800), 0.0
        T = np.array([1j * w * R @ np.linalg.solve(1j * w * np.eye(2) - A, L) for w in frequencies])
        for x in np.geomspace(1e-2, 1e2, 80):
            room = 1.0 - e**2 * np.abs(T[:, 1, 1]) ** 2 - e**2 * x * np.abs(T[:, 1, 0]) ** 2
            if (room <= 0.0).any():
                continue
            low, high = 0.0, 1.0
            for _ in range(25):
                d = (low + high) / 2.0
                scaled = T * np.array([[d, d / math.sqrt(x)], [e * math.sqrt(x), e]])
                good = np.linalg.norm(scaled, 2, axis=(1, 2)).max() < 1.0
                low, high = (d, high) if good else (low, d)
            best = max(best, low)
        found = DelayedLoop(A_0, B, C, A_e=A_e, embedded_delay=e).jitter_margin().delay
        assert found == pytest.approx(best, rel=2e-3)

    @pytest.mark.parametrize("period", [3, 7, 20, 53])
    def test_both_may_vary(self, period):
        A_0, B, C, A_e = self.loop()
        found = DelayedLoop(A_0, B, C, A_e=A_e, embedded_delay=0.01).jitter_margin().delay
        step = 1e-4
        sizes = run(
            A_0, B, C, lambda t, past: int(0.99 * found / step) * (round(t / step) // period % 2),
            step=step, time=3.0, A_e=A_e, late=lambda t, past: 100 * (round(t / step) // 31 % 2),
        )  # fmt: skip
        assert sizes[-200:].max() < 0.1

    def test_a_delay_that_is_too_long_proves_nothing(self):
        A_0, B, C, A_e = self.loop()
        found = DelayedLoop(A_0, B, C, A_e=A_e, embedded_delay=1.0).jitter_margin()
        assert found.delay == 0.0
        assert found.unstable_roots == 0


class TestChannels:
    """Signals with a delay of their own each, all varying at once."""

    def loop(self, seed=0):
        A_0, B, C, _ = plant(np.random.default_rng(seed), law="pd")
        N = len(A_0)
        rates = np.arange(N) >= N // 2
        n = len(C)
        parts = np.vstack([np.where(rates, 0.0, C), np.where(rates, C, 0.0)])
        rows = {"positions": range(n), "rates": range(n, 2 * n)}
        return A_0, np.hstack([B, B]), parts, rows

    def test_two_late_integrators_add_up(self):
        """ẋ = −a x(t − σ) − b x(t − τ): T has the norm a + b at ω → ∞ with the best weight."""
        for a, b in ((1.0, 1.0), (1.0, 2.0), (0.01, 30.0)):
            found = DelayedLoop([[0.0]], [[1.0, 1.0]], [[-a], [-b]]).jitter_margin(
                {"a": [0], "b": [1]}
            )
            assert found.delay == pytest.approx(1.0 / (a + b), rel=1e-4)
            assert found.delay <= 1.0 / (a + b) * (1.0 + 1e-9) <= found.upper * (1.0 + 1e-6)
            assert found.channels["a"] == pytest.approx(1.0 / a, rel=1e-8)
            assert found.channels["b"] == pytest.approx(1.0 / b, rel=1e-8)

    def test_one_channel_is_the_jitter_margin(self):
        A_0, B, C, _ = self.loop()
        one = DelayedLoop(A_0, B, C)
        found = one.jitter_margin({"all": range(len(C))})
        assert found.delay == pytest.approx(one.jitter_margin().delay, rel=1e-8)
        assert found.channels["all"] == found.delay

    @pytest.mark.parametrize("seed", range(4))
    def test_all_at_once_is_proven_by_the_weighed_norm(self, seed):
        """The norm over a fine grid, no coarse weight better, and constant delays as a bound."""
        A_0, B, C, rows = self.loop(seed)
        loop = DelayedLoop(A_0, B, C)
        found = loop.jitter_margin(rows)
        if found.unstable_roots:
            pytest.skip("unstable without delay")
        assert found.delay <= min(found.channels.values()) * (1.0 + 1e-9)
        assert found.delay <= min(found.upper, loop.margin().delay)
        A, n = A_0 + B @ C, len(C) // 2
        sides = []
        for at in (slice(0, n), slice(n, 2 * n)):
            U, values, V = np.linalg.svd(C[at], full_matrices=False)
            sides.append((B[:, at] @ U * np.sqrt(values), np.sqrt(values)[:, None] * V))
        L, R = np.hstack([a for a, _ in sides]), np.vstack([b for _, b in sides])
        grid = np.concatenate([np.geomspace(1e-2, 1e5, 600), np.abs(np.linalg.eigvals(A))])
        T = [1j * w * R @ np.linalg.solve(1j * w * np.eye(len(A)) - A, L) for w in grid]
        best = 0.0
        for power in np.linspace(-6, 6, 61):
            pull = np.repeat([1.0, 10.0 ** (power / 2.0)], n)
            sizes = [np.linalg.norm(pull[:, None] * one / pull, 2) for one in T]
            best = max(best, 1.0 / max(sizes))
        assert found.delay >= best * (1.0 - 1e-3)
        assert found.delay <= best * 1.1

    @pytest.mark.parametrize("periods", [(3, 7), (20, 13), (1, 53)])
    def test_no_two_delays_below_it_make_the_loop_grow(self, periods):
        A_0, B, C, rows = self.loop()
        found, N, m = DelayedLoop(A_0, B, C).jitter_margin(rows), len(A_0), len(C)
        step = found.delay / 40.0
        most = int(0.99 * found.delay / step)
        x, past = np.ones(N), [np.ones(N)] * 200
        block = np.zeros((N + m, N + m))
        block[:N, :N], block[:N, N:] = A_0, B
        phi, sizes = expm(block * step)[:N], []
        for k in range(4000):
            late = np.repeat([most * (k // period % 2) for period in periods], m // 2)
            u = np.array([C[i] @ past[-1 - steps] for i, steps in enumerate(late)])
            x = phi @ np.concatenate([x, u])
            past.append(x)
            sizes.append(float(np.linalg.norm(x)))
        assert max(sizes[-200:]) < 0.5 * max(sizes[:400])

    @pytest.mark.parametrize("rows", [{"a": [0]}, {"a": [0, 1], "b": [1]}, {"a": [0, 5]}])
    def test_each_row_is_in_one_channel(self, rows):
        with pytest.raises(InputError, match="each of the 2 rows"):
            DelayedLoop([[0.0]], [[1.0, 1.0]], [[-1.0], [-1.0]]).jitter_margin(rows)


def test_symmetries_are_left_out():
    A_0, B, C, _ = plant(np.random.default_rng(5), law="stiffness")
    N = len(A_0)
    wide = np.zeros((N + 2, N + 2))
    wide[:N, :N], wide[N, N + 1] = A_0, 1.0
    along = np.zeros((N + 2, 1))
    along[N] = 1.0
    none = np.zeros((2, B.shape[1]))
    found = DelayedLoop(
        wide, np.vstack([B, none]), np.hstack([C, none.T]), symmetries=along
    ).jitter_margin()
    assert found.neutral == 2
    assert found.delay == pytest.approx(DelayedLoop(A_0, B, C).jitter_margin().delay, rel=1e-8)


def test_what_is_unstable_has_none_and_what_is_not_late_has_no_end():
    A_0, B, C = joint(0.1, -1.0, 100.0)
    assert DelayedLoop(A_0, B, C).jitter_margin().delay == 0.0
    assert DelayedLoop(A_0, B, C).jitter_margin().unstable_roots == 2
    A_0, B, C = joint(0.1, 1.0, 0.0)
    assert DelayedLoop([[-1.0]], [[1.0]], [[0.0]]).jitter_margin().delay == math.inf
    assert DelayedLoop([[-1.0]], [[0.0]], [[3.0]]).jitter_margin().delay == math.inf


def test_an_undamped_motion_beside_the_loop_counts_as_unstable():
    A_0 = np.zeros((3, 3))
    A_0[0, 0], A_0[1, 2], A_0[2, 1] = -1.0, 1.0, -4.0
    B, C = np.eye(3)[:, :1], -np.eye(3)[:1]
    assert DelayedLoop(A_0, B, C).jitter_margin().unstable_roots == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"B": [[1.0]]}, "B is"),
        ({"C": [[1.0, 2.0, 3.0]]}, "C "),
        ({"B": [[math.nan], [1.0]]}, "finite"),
        ({"A_0": [[1.0, 2.0]]}, "square"),
        ({"embedded_delay": -1.0}, "embedded_delay"),
        ({"A_e": [[1.0]], "embedded_delay": 1.0}, "A_e"),
    ],
)
def test_wrong_inputs_are_named(changes, words):
    A_0, B, C = joint(0.1, 10.0, 100.0)
    call = {"A_0": A_0, "B": B, "C": C, **changes}
    with pytest.raises(InputError, match=words):
        DelayedLoop(**call).jitter_margin()


def test_a_direction_that_is_no_symmetry_is_refused():
    A_0, B, C = joint(0.1, 10.0, 100.0)
    with pytest.raises(SolverError, match="no symmetry"):
        DelayedLoop(A_0, B, C, symmetries=[[0.0], [1.0]]).jitter_margin()


@pytest.mark.parametrize("law", ["stiffness", "asymmetric", "pd", "links"])
def test_what_is_asked_for_is_proven_if_and_only_if_it_is_below_the_margin(law):
    """One level of the norm decides; the control is the level just above it."""
    for seed in range(4):
        A_0, B, C, _ = plant(np.random.default_rng(seed), law=law)
        loop = DelayedLoop(A_0, B, C)
        whole = loop.jitter_margin()
        if not 0.0 < whole.delay < math.inf:
            continue
        for share in (1e-3, 0.5, 0.999):
            asked = loop.jitter_margin(at_most=share * whole.delay)
            assert asked.delay == share * whole.delay
        for share in (1.001, 2.0, 1e3):
            assert loop.jitter_margin(at_most=share * whole.delay).delay == whole.delay


def test_nothing_is_proven_of_a_loop_that_is_unstable_without_delay():
    A_0, B, C = joint(0.1, -1.0, 100.0)
    assert DelayedLoop(A_0, B, C).jitter_margin(at_most=1e-6).delay == 0.0
    with pytest.raises(InputError, match="at_most"):
        DelayedLoop(A_0, B, C).jitter_margin(at_most=-1.0)
