"""Motor kernels against matrix exponentials and quadrature in plain NumPy and SciPy."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from sealag.kernels import motor

COLUMNS = (
    "K", "D_s", "B", "ratio", "D", "viscous", "coulomb", "limit", "speed", "bandwidth", "bearing",
)  # fmt: skip


def parameters(**changes):
    ideal = (np.inf,) * 3
    values = dict(zip(COLUMNS, (350.0, 0.5, 0.093, 2.0, 100.0, 0.2, 0.0, *ideal, 0.0)))
    return np.array([[{**values, **changes}[name] for name in COLUMNS]])


def reference_matrix(p, instant, variant):
    """A of ż = A z and the five products' rows, written out from Eqs. (5)-(8)."""
    K, D_s, B, ratio, D, viscous, _, _, _, bandwidth, _ = p
    e = np.eye(9)
    theta, omega, torque, q, q1, q2, q3, u, w = e
    spring = K * (theta - q) + D_s * (omega - q1)
    command = u if variant % 2 else ratio * (u - D * omega) + instant * (1 - ratio) * spring
    ideal = np.isinf(bandwidth)
    tau_m = command if ideal else torque
    A = np.zeros((9, 9))
    A[3], A[4], A[5] = q1, q2, q3
    A[2] = 0 if ideal else bandwidth * (command - torque)
    if variant < 2:
        A[0] = omega
        A[1] = (tau_m - spring - viscous * omega + w) / B
    pairs = [(omega, omega), (spring, q1), (spring, omega), (omega - q1, omega - q1)]
    return A, [*pairs, (tau_m, omega)]


@pytest.mark.parametrize("variant", range(4))
@pytest.mark.parametrize("bandwidth", [np.inf, 300.0])
@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_exponentials_and_works(variant, bandwidth, step):
    p = parameters(bandwidth=bandwidth)[0]
    A, Q = np.empty((9, 9)), np.empty((5, 9, 9))
    motor.generator(p, 1.0, variant, A, Q)
    expected, pairs = reference_matrix(p, 1.0, variant)
    np.testing.assert_allclose(A, expected, atol=1e-12)
    E, W = np.empty((9, 9)), np.empty((5, 9, 9))
    motor.advance(A, Q, step, E, W)
    np.testing.assert_allclose(E, expm(A * step), rtol=1e-10, atol=1e-10)
    z = np.random.default_rng(1).normal(size=9)
    for form, (a, b) in zip(W, pairs):

        def power(s, a=a, b=b):
            y = expm(A * s) @ z
            return (a @ y) * (b @ y)

        assert z @ form @ z == pytest.approx(
            quad(power, 0, step, epsrel=1e-11, limit=200)[0], rel=1e-9, abs=1e-12
        )


def _move(p, z, tau, step, regular, instant=1.0, measured=0.0):
    n = len(p)
    half, whole = np.empty((n, 4, 9, 9)), np.empty((n, 4, 9, 9))
    forms, work = np.empty((n, 4, 5, 9, 9)), np.zeros((n, 8))
    motor.tables(p, instant, step, half, whole, forms)
    tau, measured = np.full(n, tau), np.full(n, measured)
    motor.move(p, instant, tau, measured, z, step, whole, forms, regular, True, work)
    return z, work


def _simulate(p, z, tau, step, instant=1.0, measured=0.0):
    """The same joint by an adaptive integrator, friction and limits evaluated as they come."""
    K, D_s, B, ratio, D, viscous, coulomb, limit, _, _, _ = p[0]

    def rate(t, x):
        q = z[3] + z[4] * t + z[5] * t**2 / 2 + z[6] * t**3 / 6
        q1 = z[4] + z[5] * t + z[6] * t**2 / 2
        spring = K * (x[0] - q) + D_s * (x[1] - q1)
        command = ratio * (tau - D * x[1]) + (1 - ratio) * (spring if instant else measured)
        command = min(max(command, -limit), limit)
        net = command - spring - viscous * x[1]
        if coulomb and abs(x[1]) < 1e-9:
            net = 0.0 if abs(net) <= coulomb else net - np.sign(net) * coulomb
        else:
            net -= coulomb * np.sign(x[1])
        out = [x[1], net / B, command * x[1], coulomb * abs(x[1]), tau * x[1]]
        return out

    answer = solve_ivp(rate, (0, step), [z[0], z[1], 0, 0, 0], rtol=1e-9, atol=1e-12,
                       max_step=step / 400)  # fmt: skip
    return answer.y[:, -1]


@pytest.mark.parametrize(
    ("changes", "tau"),
    [
        ({}, 12.0),
        ({"coulomb": 1.5, "D": 5.0}, 12.0),
        ({"coulomb": 1.5, "D": 5.0}, -30.0),  # turns round inside the step
        ({"limit": 6.0}, 40.0),
        ({"limit": 6.0, "coulomb": 0.5, "D_s": 0.0}, -40.0),
    ],
)
@pytest.mark.parametrize("regular", [True, False])
def test_move_with_friction_and_limits(changes, tau, regular):
    p = parameters(**changes)
    z = np.zeros((1, 9))
    z[0, :7] = [0.1, 0.3, 0.0, 0.08, 0.5, -2.0, 30.0]
    expected = _simulate(p, z[0].copy(), tau, 4e-3)
    moved, work = _move(p, z, tau, 4e-3, regular)
    np.testing.assert_allclose(moved[0, :2], expected[:2], rtol=2e-5, atol=2e-6)
    np.testing.assert_allclose(
        [work[0, 4], p[0, 6] * work[0, 5], work[0, 6]], expected[2:], rtol=1e-3, atol=2e-5
    )


def test_coulomb_friction_holds_and_lets_go():
    p = parameters(coulomb=2.0, D=5.0, ratio=1.0)
    held, work = _move(p, np.zeros((1, 9)), 1.9, 1e-2, True)
    assert held[0, 0] == held[0, 1] == 0.0
    assert not work.any()
    gone, _ = _move(p, np.zeros((1, 9)), 2.1, 1e-2, True)
    assert gone[0, 0] > 0.0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_velocity_limit_takes_away_driving_torque(way):
    p = parameters(speed=1.0, D=0.1, D_s=0.0, viscous=0.0, K=1e-6)
    z = np.zeros((1, 9))
    z[0, 1] = 1.5 * way
    moved, work = _move(p, z, 50.0 * way, 1e-3, True)
    assert moved[0, 1] == pytest.approx(1.5 * way, abs=1e-6)
    assert abs(work[0, 4]) < 1e-9
    braking, _ = _move(p, moved.copy(), -50.0 * way, 1e-3, True)
    assert abs(braking[0, 1]) < 1.5
    z[0, 1] = 0.5 * way  # below the limit the motor drives
    driven, _ = _move(p, z, 50.0 * way, 1e-3, True)
    assert driven[0, 1] * way > 0.5


def test_link_work_is_the_integral_of_its_squared_speed():
    rng, z, work, step = np.random.default_rng(4), np.zeros((2, 9)), np.zeros((2, 8)), 3e-3
    ends = rng.normal(size=(4, 2))
    motor.link_cubic(z, *ends, step)
    motor.add_link_work(z, step, work)
    for row, done, end in zip(z, work[:, 7], ends[3]):
        speed = np.polynomial.Polynomial([row[4], row[5], row[6] / 2])
        assert done == pytest.approx(quad(lambda t, v=speed: v(t) ** 2, 0, step)[0], rel=1e-12)
        assert speed(step) == pytest.approx(end)
    assert not work[:, :7].any()


def test_tally_weighs_every_work_with_its_own_coefficient():
    """Nine flows of two joints, all different: D_θ, friction, D_s and bearing where they belong."""
    rng = np.random.default_rng(5)
    p, work, z, q = rng.uniform(1, 2, (2, 11)), rng.uniform(1, 2, (2, 8)), np.zeros((2, 9)), [0, 0]
    joint, scalar, energy = np.zeros((9, 2)), np.zeros(5), np.zeros(4)
    powers = rng.uniform(1, 2, (4, 6))
    motor.tally(p, work, powers, 0.6, z, np.array(q, float), powers[0], joint, scalar, energy,
                np.zeros(1))  # fmt: skip
    w, one = work.T, np.ones(2)
    expected = np.array(
        [one * w[1], w[2], w[4], w[6], p[:, 4] * w[0], p[:, 5] * w[0], p[:, 6] * w[5],
         p[:, 1] * w[3], p[:, 10] * w[7]]
    )  # fmt: skip
    np.testing.assert_allclose(joint, expected)
    simpson = np.array([1, 2, 2, 1]) @ powers[:, :4] / 6 * 0.6
    np.testing.assert_allclose(scalar, [*simpson, 0.0])


def test_late_torque_feedback_is_held():
    p = parameters()
    z = np.zeros((1, 9))
    z[0, :4] = [0.1, 0.3, 0.0, 0.08]
    expected = _simulate(p, z[0].copy(), 5.0, 2e-3, instant=0, measured=3.0)
    moved, _ = _move(p, z, 5.0, 2e-3, True, instant=0.0, measured=3.0)
    np.testing.assert_allclose(moved[0, :2], expected[:2], rtol=1e-6, atol=1e-8)
