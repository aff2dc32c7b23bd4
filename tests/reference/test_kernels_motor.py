"""Motor kernels against matrix exponentials and quadrature in plain NumPy and SciPy."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from helpers.kernels import from_python
from sealag.kernels import motor, motor_step
from sealag.kernels.ledger import (
    COMMAND,
    COULOMB,
    DAMPING,
    JOINT_DAMPING,
    MOTOR_WORK,
    PORT,
    SHAFT,
    SPRING_DAMPING,
    VISCOUS,
)

COLUMNS = (
    "K", "D_s", "B", "ratio", "D", "viscous", "coulomb", "limit", "speed", "bandwidth", "bearing",
)  # fmt: skip
TRAVEL, MOVE, RATES = (
    from_python(kernel) for kernel in (motor.travel, motor_step.move, motor.rates)
)
PREDICT = from_python(motor_step.predict)
LINK_WORK, SERIES = from_python(motor.link_work), motor.allocate_series


def parameters(**changes):
    ideal = (np.inf,) * 3
    values = dict(zip(COLUMNS, (350.0, 0.5, 0.093, 2.0, 100.0, 0.2, 0.0, *ideal, 0.0)))
    return np.array([[{**values, **changes}[name] for name in COLUMNS]])


def motors_of(p):
    """The rows of parameters as kernels take them."""
    return motor.Motors(*(np.ascontiguousarray(column) for column in p.T))


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


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("locked", [False, True])
@pytest.mark.parametrize("bandwidth", [np.inf, 300.0])
@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_a_rotor_moves_as_the_matrix_exponential_says(limited, locked, bandwidth, step):
    """State and works of every mode: z = [rotor, link, u, w] obeys ż = A z."""
    p = parameters(bandwidth=bandwidth)
    A, pairs = reference_matrix(p[0], 1.0, limited + 2 * locked)
    z = np.random.default_rng(1).normal(size=9)
    if locked:
        z[1] = z[8] = 0.0
    motors, drive = motors_of(p), motor.Drive(limited, locked, z[7], z[8])
    rotor, link = motor.Rotor(*z[:3]), motor.Link(*z[3:7])
    rate, _, _ = RATES(motors, 0, True, drive, rotor, link.angle, link.speed)
    np.testing.assert_allclose(rate, (A @ z)[:3], atol=1e-9)
    after, works = TRAVEL(motors, 0, True, drive, rotor, link, step, SERIES(), True)
    end = expm(A * step) @ z
    np.testing.assert_allclose(after, end[:3], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(motor.link_at.py_func(link, step), end[3:7], rtol=1e-12)
    for found, (a, b) in zip(works, pairs):

        def power(s, a=a, b=b):
            y = expm(A * s) @ z
            return (a @ y) * (b @ y)

        assert found == pytest.approx(
            quad(power, 0, step, epsrel=1e-11, limit=200)[0], rel=1e-9, abs=1e-12
        )


def test_each_mode_moves_otherwise():
    """Negative control of the test above: its cases tell the modes apart."""
    ends = set()
    for limited in (False, True):
        for bandwidth in (np.inf, 300.0):
            drive = motor.Drive(limited, False, 3.0, 0.0)
            after, _ = TRAVEL(
                motors_of(parameters(bandwidth=bandwidth)), 0, True, drive,
                motor.Rotor(0.1, 0.3, 0.0), motor.Link(0.08, 0.5, -2.0, 30.0), 1e-3, SERIES(), True,
            )  # fmt: skip
            ends.add(round(after.speed, 6))
    assert len(ends) == 4


def _held(tau, later, *, change=np.inf, look=np.inf, measured=0.0, instant=True):
    """What one drive holds over a step."""
    values = (np.full(1, value) for value in (tau, later, change, look, measured))
    return motor_step.Held(*values, instant)


def _move(p, z, tau, step, instant=1.0, measured=0.0):
    """Move the rotors of z (n, 9) = [rotor, link, ...]; their rotors (n, 3) and works (9, n)."""
    n = len(p)
    command, never = np.full(n, tau), np.full(1, np.inf)
    held = motor_step.Held(command, command, never, never, np.full(n, measured), bool(instant))
    flows, moved = np.full((9, n), np.nan), np.zeros((n, 3))
    for j in range(n):
        moved[j] = MOVE(
            motors_of(p), j, held, motor.Rotor(*z[j, :3]), motor.Link(*z[j, 3:7]), step, SERIES(),
            flows, np.zeros((2, n)),
        )  # fmt: skip
    return moved, flows


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
def test_move_with_friction_and_limits(changes, tau):
    p = parameters(**changes)
    z = np.zeros((1, 9))
    z[0, :7] = [0.1, 0.3, 0.0, 0.08, 0.5, -2.0, 30.0]
    expected = _simulate(p, z[0].copy(), tau, 4e-3)
    moved, work = _move(p, z, tau, 4e-3)
    np.testing.assert_allclose(moved[0, :2], expected[:2], rtol=2e-5, atol=2e-6)
    np.testing.assert_allclose(
        work[[MOTOR_WORK, COULOMB, COMMAND], 0], expected[2:], rtol=1e-3, atol=2e-5
    )


def test_coulomb_friction_holds_and_lets_go():
    p = parameters(coulomb=2.0, D=5.0, ratio=1.0)
    held, work = _move(p, np.zeros((1, 9)), 1.9, 1e-2)
    assert held[0, 0] == held[0, 1] == 0.0
    assert not work.any()
    gone, _ = _move(p, np.zeros((1, 9)), 2.1, 1e-2)
    assert gone[0, 0] > 0.0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_velocity_limit_takes_away_driving_torque(way):
    p = parameters(speed=1.0, D=0.1, D_s=0.0, viscous=0.0, K=1e-6)
    z = np.zeros((1, 9))
    z[0, 1] = 1.5 * way
    moved, work = _move(p, z, 50.0 * way, 1e-3)
    assert moved[0, 1] == pytest.approx(1.5 * way, abs=1e-6)
    assert abs(work[MOTOR_WORK, 0]) < 1e-9
    z[0, :3] = moved
    braking, _ = _move(p, z, -50.0 * way, 1e-3)
    assert abs(braking[0, 1]) < 1.5
    z[0, :3] = 0.0, 0.5 * way, 0.0  # below the limit the motor drives
    driven, _ = _move(p, z, 50.0 * way, 1e-3)
    assert driven[0, 1] * way > 0.5


def test_link_work_is_the_integral_of_its_squared_speed():
    rng, step = np.random.default_rng(4), 3e-3
    for ends in rng.normal(size=(2, 4)):
        link = motor.link_through.py_func(*ends, step)
        speed = np.polynomial.Polynomial([link.speed, link.bend, link.jerk / 2])
        done = LINK_WORK(link, step)
        assert done == pytest.approx(quad(lambda t, v=speed: v(t) ** 2, 0, step)[0], rel=1e-12)
        assert speed(step) == pytest.approx(ends[3])
        assert motor.link_at.py_func(link, step).angle == pytest.approx(ends[2])


def test_every_work_has_its_own_coefficient():
    """Nine flows of two joints, all different: D_θ, friction, D_s and bearing where they belong."""
    rng = np.random.default_rng(5)
    works, way, flows = motor.Works(*rng.uniform(1, 2, 5)), -0.7, np.zeros((9, 2))
    p = rng.uniform(1, 2, (2, 11))
    motors = motors_of(p)
    for j in (0, 1):
        from_python(motor_step._book)(motors, j, works, way, 3.0, flows)
    expected = np.zeros((9, 2))
    one = np.ones(2)
    expected[PORT], expected[SHAFT] = works.port * one, works.shaft * one
    expected[MOTOR_WORK], expected[COMMAND] = works.motor * one, 3.0 * way * one
    expected[DAMPING] = p[:, 4] * works.speed_squared
    expected[VISCOUS] = p[:, 5] * works.speed_squared
    expected[COULOMB] = p[:, 6] * abs(way)
    expected[SPRING_DAMPING] = p[:, 1] * works.slip_squared
    np.testing.assert_allclose(flows, expected)
    z = np.zeros((2, 9))
    z[:, 4] = 0.3  # a link that moves with constant speed
    _, moved = _move(p, z, 0.0, 1e-3)
    np.testing.assert_allclose(moved[JOINT_DAMPING], p[:, 10] * 0.3**2 * 1e-3)


def test_late_torque_feedback_is_held():
    p = parameters()
    z = np.zeros((1, 9))
    z[0, :4] = [0.1, 0.3, 0.0, 0.08]
    expected = _simulate(p, z[0].copy(), 5.0, 2e-3, instant=0, measured=3.0)
    moved, _ = _move(p, z, 5.0, 2e-3, instant=0.0, measured=3.0)
    np.testing.assert_allclose(moved[0, :2], expected[:2], rtol=1e-6, atol=1e-8)


STARTS = (motor.Rotor(0.1, 0.3, 0.0), motor.Link(0.08, 0.5, -2.0, 30.0))


@pytest.mark.parametrize(("change", "look"), [(0.3e-3, 0.7e-3), (0.7e-3, 0.3e-3), (0.5e-3, 0.5e-3)])
@pytest.mark.parametrize("coulomb", [0.0, 1.5])
def test_a_command_that_changes_inside_a_step_makes_it_two(change, look, coulomb):
    """End and works are those of two steps; what sensors see is the end of one that ends there."""
    motors, (rotor, link), step = motors_of(parameters(coulomb=coulomb)), STARTS, 1e-3
    seen, flows = np.zeros((2, 1)), np.zeros((9, 1))
    held = _held(12.0, -30.0, change=change, look=look)
    end = MOVE(motors, 0, held, rotor, link, step, SERIES(), flows, seen)

    def parts(until):
        at, work, here = rotor, np.zeros((9, 1)), 0.0
        for tau, there in ((12.0, min(change, until)), (-30.0, until)):
            if there > here:
                part, moved = np.zeros((9, 1)), motor.link_at.py_func(link, here)
                span = there - here
                at = MOVE(motors, 0, _held(tau, tau), at, moved, span, SERIES(), part, seen.copy())
                work, here = work + part, there
        return at, work

    expected, work = parts(step)
    np.testing.assert_allclose(end, expected, rtol=1e-9)  # a reversal is found to 1e-13 of a step
    np.testing.assert_allclose(flows, work, rtol=1e-9, atol=1e-16)
    np.testing.assert_allclose(seen[:, 0], parts(look)[0][:2], rtol=1e-9)
    steady = MOVE(motors, 0, _held(12.0, 0.0), rotor, link, step, SERIES(), flows, seen)
    assert abs(steady.speed - end.speed) > 1e-2


@pytest.mark.parametrize("change", [np.inf, 0.4e-3])
@pytest.mark.parametrize("damping", [10.0, 100.0])  # one series a part, and several
def test_stages_have_the_mean_and_the_first_moment_of_the_motion(change, damping):
    """Simpson's sums of angle and speed are integrals along the motion, kinks included."""
    motors, (rotor, link), step = motors_of(parameters(D=damping)), STARTS, 1e-3
    held = _held(12.0, -300.0, change=change)
    middle, last = PREDICT(motors, 0, held, rotor, link, step, SERIES())

    def moved(s):
        until = _held(12.0, -300.0, change=change if change < s else np.inf)
        room = np.zeros((9, 1)), np.zeros((2, 1))
        return MOVE(motors, 0, until, rotor, link, s, SERIES(), *room) if s else rotor

    for name, size in (("angle", 1.0), ("speed", 100.0)):
        first, f_half, f_one = (getattr(at, name) for at in (rotor, middle, last))

        def value(s, name=name):
            return getattr(moved(s), name)

        options = {"points": [0.4e-3], "epsabs": 1e-14, "epsrel": 1e-13}
        mean = quad(value, 0, step, **options)[0]
        moment = quad(lambda s, f=value: (step - s) * f(s), 0, step, **options)[0]
        assert step * (first + 4 * f_half + f_one) / 6 == pytest.approx(mean, abs=1e-13 * size)
        assert step**2 * (first + 2 * f_half) / 6 == pytest.approx(moment, abs=1e-16 * size)
        away = abs(f_half - value(0.5 * step)) / size  # the value is no substitute where it bends
        if damping == 10.0:
            assert (away < 1e-5) == (change == np.inf)
