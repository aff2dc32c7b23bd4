"""Sampled and held loops: textbook limits, and a simulation that shares no code."""

import heapq
import math

import numpy as np
import pytest
from scipy.linalg import expm

from sealag.errors import InputError
from sealag.margin import DelayedLoop

INTEGRATOR = ([[0.0]], [[1.0]])


def spring_joint():
    """A link on a spring, its motor, and motor feedback of gain 100."""
    A_0 = np.array([
        [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0],
        [-350.0, 350.0, -0.1, 0.0], [3500.0, -3500.0, 0.0, -100.0],
    ])  # fmt: skip
    return A_0, np.array([[0.0], [0.0], [0.0], [10.0]]), np.array([[0.0, -100.0, 0.0, 0.0]])


def simulated(A_0, B, C, *, period, delay, periods):
    """|x| at each sample: exact motion between events, commands in a queue by when they arrive."""
    N = len(A_0)
    both = np.zeros((N + B.shape[1], N + B.shape[1]))
    both[:N, :N], both[:N, N:] = A_0, B
    x, u, t, sizes = np.ones(N), np.zeros(B.shape[1]), 0.0, []
    waiting = []
    for k in range(periods):
        sizes.append(float(np.linalg.norm(x)))
        heapq.heappush(waiting, (k * period + delay, tuple(C @ x)))
        end = (k + 1) * period
        while True:
            due = min(waiting[0][0], end) if waiting else end
            x = (expm(both * (due - t)) @ np.concatenate([x, u]))[:N]
            t = due
            if due >= end:
                break
            u = np.array(heapq.heappop(waiting)[1])
    return np.array(sizes)


def rate_of(sizes, window=20):
    """Growth a period over the second half, of the largest size in a window."""
    half = len(sizes) // 2
    growth = sizes[-window:].max() / sizes[half : half + window].max()
    return growth ** (1.0 / (len(sizes) - half - window))


@pytest.mark.parametrize(
    ("periods_late", "limit"), [(0.0, 2.0), (1.0, 1.0), (2.0, (math.sqrt(5.0) - 1.0) / 2.0)]
)
@pytest.mark.parametrize("gain", [1.0, 7.0])
def test_an_integrator_has_its_textbook_limits(periods_late, limit, gain):
    """z − 1 + kT = 0, z² − z + kT = 0, z³ − z² + kT = 0."""
    for share in (0.999, 1.001):
        T = share * limit / gain
        radius = DelayedLoop(*INTEGRATOR, [[-gain]]).sampled_radius(
            period=T, delay=periods_late * T
        )
        assert (radius < 1.0) == (share < 1.0)


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.01, 0.0137, 0.02])
def test_the_radius_is_the_growth_of_a_simulation(delay):
    for period in (0.01, 0.04):
        A_0, B, C = spring_joint()
        sizes = simulated(A_0, B, C, period=period, delay=delay, periods=600)
        radius = DelayedLoop(A_0, B, C).sampled_radius(period=period, delay=delay)
        assert rate_of(sizes) == pytest.approx(radius, abs=2e-3)


@pytest.mark.parametrize("period", [0.004, 0.02, 0.06])
def test_a_simulation_decays_below_the_margin_and_grows_above(period):
    A_0, B, C = spring_joint()
    found = DelayedLoop(A_0, B, C).sampled_margin(period=period)
    assert found.proven <= found.delay
    for share in (0.97, 1.03):
        sizes = simulated(A_0, B, C, period=period, delay=share * found.delay, periods=1500)
        assert (rate_of(sizes, window=round(1.0 / period)) < 1.0) == (share < 1.0)


def test_fast_sampling_tends_to_the_continuous_margin():
    """A hold is half a period late on average."""
    A_0, B, C = spring_joint()
    exact = DelayedLoop(A_0, B @ C).margin().delay
    lost = [
        exact - DelayedLoop(A_0, B, C).sampled_margin(period=T).delay for T in (0.02, 0.01, 0.005)
    ]
    np.testing.assert_allclose(lost, [0.01, 0.005, 0.0025], rtol=0.05)


def test_up_to_the_jitter_margin_less_a_period_it_is_proven():
    A_0, B, C = spring_joint()
    varying = DelayedLoop(A_0, B, C).jitter_margin().delay
    assert DelayedLoop(A_0, B, C).sampled_margin(period=0.01).proven == varying - 0.01
    assert DelayedLoop(A_0, B, C).sampled_margin(period=2.0 * varying).proven == 0.0


def test_the_last_step_is_bisected():
    A_0, B, C = spring_joint()
    found = DelayedLoop(A_0, B, C).sampled_margin(period=0.02)
    assert DelayedLoop(A_0, B, C).sampled_radius(period=0.02, delay=found.delay) < 1.0
    assert DelayedLoop(A_0, B, C).sampled_radius(period=0.02, delay=found.delay + 2e-6) > 1.0


def test_ends():
    assert DelayedLoop([[-1.0]], [[1.0]], [[0.0]]).sampled_margin(period=0.1).delay == math.inf
    assert DelayedLoop([[1.0]], [[1.0]], [[0.5]]).sampled_margin(period=0.1).delay == 0.0
    assert DelayedLoop(*INTEGRATOR, [[-1.0]]).sampled_margin(period=2.1).delay == 0.0
    slow = DelayedLoop([[-1.0]], [[1.0]], [[-1.01]]).sampled_margin(period=1e-3)
    assert slow.delay is None
    assert slow.proven > 0.9


def test_symmetries_are_left_out():
    A_0, B, C = spring_joint()
    wide = np.zeros((6, 6))
    wide[:4, :4], wide[4, 5] = A_0, 1.0
    along = np.eye(6)[:, 4:5]
    both = np.vstack([B, np.zeros((2, 1))]), np.hstack([C, np.zeros((1, 2))])
    found = DelayedLoop(wide, *both, symmetries=along).sampled_radius(period=0.01, delay=0.01)
    assert found == pytest.approx(
        DelayedLoop(A_0, B, C).sampled_radius(period=0.01, delay=0.01), rel=1e-9
    )


def lagging(a, k, **more):
    """ẋ = u and ξ̇ = a (x − ξ), u = −k ξ."""
    return DelayedLoop([[0.0, 0.0], [a, -a]], [[1.0], [0.0]], [[0.0, -k]], memory=1, **more)


@pytest.mark.parametrize("a", [0.3, 20.0])
@pytest.mark.parametrize("share", [0.999, 1.001])
def test_memory_that_ticks_has_its_characteristic_polynomial(a, share):
    """ξ_{k+1} = e ξ + (1 − e) x and x_{k+1} = x − kT ξ: z² − (1 + e) z + e + kT (1 − e), kT < 1."""
    k, T = 3.0, share / 3.0
    e = math.exp(-a * T)
    radius = lagging(a, k).sampled_radius(period=T, delay=0.0)
    assert radius == pytest.approx(np.abs(np.roots([1.0, -1.0 - e, e + k * T * (1.0 - e)])).max())
    assert (radius < 1.0) == (share < 1.0)


def test_memory_of_a_period_is_its_own_matrices():
    """A_d = 0: ξ_{k+1} = b x, u = −ξ, a command one tick late; nothing is said of other periods."""
    T, b = 0.1, 4.0
    # bilinear: A_c = −2/T, B_c = b, C_c = 4/T C, D_c = −C b
    loop = DelayedLoop(
        [[0.0, 0.0], [b, -2.0 / T]], [[1.0], [0.0]], [[b, -4.0 / T]], memory=1, memory_period=T
    )
    radius = loop.sampled_radius(period=T, delay=0.0)
    late = DelayedLoop(*INTEGRATOR, [[-b]]).sampled_radius(period=T, delay=T)
    assert radius == pytest.approx(late, rel=1e-9)
    assert loop.sampled_margin(period=T).proven == 0.0
    with pytest.raises(InputError, match="other rates"):
        loop.sampled_margin(period=2.0 * T)


def test_what_is_proven_beside_memory_counts_both_holds():
    """Two multipliers: the rate of x by the command, and of what drives ξ."""
    loop = lagging(20.0, 0.3)
    for T in (0.05, 0.2):
        found = loop.sampled_margin(period=T)
        assert 0.0 < found.proven < min(found.delay, loop.jitter_margin().delay - T)
    assert found.delay == pytest.approx(loop.margin().delay - 0.2, rel=2e-2)


def test_memory_beside_symmetries():
    one = lagging(5.0, 1.0)
    wide = np.zeros((4, 4))
    wide[0, 1], wide[3, 2:] = 1.0, one.A_0[1]
    both = DelayedLoop(
        wide, [[0.0], [0.0], [1.0], [0.0]], [[0.0, 0.0, 0.0, -1.0]], memory=1,
        symmetries=np.eye(4)[:, :1],
    )  # fmt: skip
    radius = one.sampled_radius(period=0.1, delay=0.13)
    assert both.sampled_radius(period=0.1, delay=0.13) == pytest.approx(radius, rel=1e-9)


@pytest.mark.parametrize("memory", [-1, 2, 3, 0.5])
def test_memory_that_is_no_part_of_the_states_is_named(memory):
    with pytest.raises(InputError, match="memory is"):
        DelayedLoop(
            [[0.0, 0.0], [1.0, -1.0]], [[1.0], [0.0]], [[0.0, -1.0]], memory=memory
        ).sampled_radius(period=0.1, delay=0.0)


def test_memory_acts_through_the_command_only():
    with pytest.raises(InputError, match="past its command"):
        DelayedLoop(
            [[0.0, 1.0], [1.0, -1.0]], [[1.0], [0.0]], [[0.0, -1.0]], memory=1
        ).sampled_radius(period=0.1, delay=0.0)


@pytest.mark.parametrize(
    ("period", "delay", "words"),
    [(0.0, 0.1, "period is 0 s"), (-1.0, 0.1, "period"), (0.1, -1.0, "delay"),
     (1e-4, 1.0, "more than can be lifted")],
)  # fmt: skip
def test_wrong_times_are_named(period, delay, words):
    with pytest.raises(InputError, match=words):
        DelayedLoop(*INTEGRATOR, [[-1.0]]).sampled_radius(period=period, delay=delay)
