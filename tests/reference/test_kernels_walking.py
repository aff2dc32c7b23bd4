"""The walking kernels against plain NumPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from helpers.kernels import from_python
from sealag.kernels import dynamics, keep, linalg, walking, walking_law, walking_state
from sealag.robot import load_robot

NV, N = 12, 6
FEET = ("left_foot", "right_foot")
pendulum, constrain = from_python(walking.pendulum), from_python(walking_law.constrain)
task_torques, least_squares = (
    from_python(walking_law.task_torques), from_python(linalg.least_squares),
)  # fmt: skip
predict, stand = from_python(walking_state.predict), from_python(walking_state.stand)
law, carry = from_python(walking_law.law), from_python(walking_law.carry)
SPRINGS = walking_law.Springs(
    stiffness=np.full(N, 350.0), damping=np.zeros(N), lag=np.zeros(N), limit=np.full(N, np.inf),
    table=np.zeros((N, 2, 4)),
)  # fmt: skip
GAINS = walking_law.Gains(
    height_stiffness=100.0, posture_stiffness=110.0, swing_stiffness=400.0, height_damping=10.0,
    posture_damping=11.0, swing_damping=20.0, heading_stiffness=7.0, heading_damping=5.0,
    planned=0.8, position_rate=10.0, damping=1e-14,
)  # fmt: skip
LEAD = walking_law.Lead(keep=0.7, time=5e-3, forward=1.0, feedback=0.5)


def biped_of(robot, q, v, **parts):
    """A robot as walking kernels know it, evaluated at q, v; parts replace what is usual."""
    terms = dynamics.allocate(robot.tree)
    dynamics.evaluate(keep(dynamics.Model(robot.tree, terms)), q, v)
    usual = {
        "springs": SPRINGS, "flight": walking_law.Flight(np.zeros(4), np.zeros((4, N))),
        "motor": np.zeros((N, 2)), "anchor": np.zeros((2, 3)), "tau_sea": np.zeros(N),
        "tau": np.zeros(N), "rates": np.zeros(N), "smooth": np.zeros(N), "lead": LEAD,
    }  # fmt: skip
    return walking_law.Biped(
        tree=robot.tree, terms=terms, mounts=robot.frame_mounts(FEET),
        feet=dynamics.allocate_frames(2, NV), gains=GAINS, q=q.copy(), v=v.copy(),
        scratch=walking_law.allocate_scratch(NV, N), **(usual | parts),
    )  # fmt: skip


@pytest.fixture
def terms():
    """Return a random robot's M, h, foot rows J, b and the random generator."""
    rng = np.random.default_rng(5)
    root = rng.standard_normal((NV, NV))
    M = root @ root.T + NV * np.eye(NV)
    return (
        M,
        rng.standard_normal(NV),
        rng.standard_normal((2, 3, NV)),
        rng.standard_normal((2, 3)),
        rng,
    )


def test_quintic_meets_both_ends():
    """All six end values, and the derivatives by differences."""
    c, out = np.zeros(6), np.zeros(3)
    start, end = np.array([0.1, -0.3, 2.0]), np.array([0.7, 0.2, -1.0])
    walking.quintic(start, end, 0.4, c)
    walking.quintic_at(c, 0.0, out)
    np.testing.assert_allclose(out, start, atol=1e-13)
    walking.quintic_at(c, 0.4, out)
    np.testing.assert_allclose(out, end, atol=1e-11)
    before, after = np.zeros(3), np.zeros(3)
    walking.quintic_at(c, 0.2 - 1e-5, before)
    walking.quintic_at(c, 0.2 + 1e-5, after)
    walking.quintic_at(c, 0.2, out)
    np.testing.assert_allclose((after - before)[:2] / 2e-5, out[1:], rtol=1e-7)


def test_pendulum_against_an_adaptive_integrator():
    """ẍ = (g + z̈)(x − p)/(z − p_z) with a moving centre of pressure and a moving height."""
    height, z = np.zeros(6), np.zeros(3)
    walking.quintic(np.array([0.9, 0.1, 0.0]), np.array([0.95, 0.0, 0.0]), 0.35, height)
    old, new = np.array([-0.2, 0.26, 0.0]), np.array([0.0, 0.0, 0.04])

    def slope(t, s):
        walking.quintic_at(height, t, z)
        share = min(t / 0.06, 1.0)
        p = old + share * (new - old)
        return np.concatenate([s[2:], (9.81 + z[2]) / (z[0] - p[2]) * (s[:2] - p[:2])])

    x, v = np.array([-0.12, 0.11]), np.array([0.6, -0.2])
    exact = solve_ivp(slope, (0.0, 0.35), np.concatenate([x, v]), rtol=1e-10, atol=1e-12).y[:, -1]
    pendulum(x, v, 0.0, 0.35, 0.06, old, new, height, 0.0, 16)
    np.testing.assert_allclose(np.concatenate([x, v]), exact, atol=2e-3)
    fine = np.array([-0.12, 0.11]), np.array([0.6, -0.2])
    pendulum(*fine, 0.0, 0.35, 0.06, old, new, height, 0.0, 1600)
    np.testing.assert_allclose(np.concatenate(fine), exact, atol=1e-5)


def _constrain(M, h, J, b):
    scratch = walking_law.allocate_scratch(NV, N)
    constrain(np.linalg.inv(M), h, J, b, scratch)
    return scratch


def test_constrained_accelerations_solve_the_saddle_point(terms):
    """v̇ = a_0 + P τ equals the solution with contact forces written out; one foot and both."""
    M, h, J, b, rng = terms
    tau = rng.standard_normal(N)
    for feet in (1, 2):
        rows, bias = J[:feet].reshape(3 * feet, NV), b[:feet].ravel()
        full = np.block([[M, -rows.T], [rows, np.zeros((3 * feet, 3 * feet))]])
        right = np.concatenate([-h, -bias])
        right[NV - N : NV] += tau
        at = _constrain(M, h, rows, bias)
        np.testing.assert_allclose(
            at.a_0 + at.P @ tau, np.linalg.solve(full, right)[:NV], atol=1e-10
        )


def test_task_torques_give_the_accelerations_wanted(terms):
    """J_t v̇ + J̇_t v is what was asked for; near a singularity the torque stays bounded."""
    M, h, J, b, rng = terms
    J_t, b_t, wanted = rng.standard_normal((N, NV)), rng.standard_normal(N), rng.standard_normal(N)
    at = _constrain(M, h, J[0], b[0])
    at.b_t[:] = b_t
    tau = np.full(N, np.nan)
    task_torques(at, J_t, wanted, 1e-14, tau)
    np.testing.assert_allclose(J_t @ (at.a_0 + at.P @ tau) + b_t, wanted, atol=1e-8)
    J_t[5] = J_t[4]
    task_torques(at, J_t, wanted, 1e-6, tau)
    assert np.abs(tau).max() < 1e5


def test_damped_least_squares_against_its_plain_twin(terms):
    """(AᵀA + δ trace(AᵀA)) x = Aᵀ r."""
    A, r = terms[0], terms[4].standard_normal(NV)
    x, G = np.full(NV, np.nan), A.T @ A
    least_squares(A, r, 1e-3, x, np.zeros((2, NV, NV)))
    plain = np.linalg.solve(G + 1e-3 * np.trace(G) * np.eye(NV), A.T @ r)
    np.testing.assert_allclose(x, plain, rtol=1e-10)


def plain_predict(M, h, J, b, q, v, motor, K, table, *, start, period, ticks, sent, begin, end):
    """The same steps with the saddle point solved anew in each."""
    moved, v, motor = np.zeros(NV), v.copy(), motor.copy()
    for i in range(ticks):
        t = start + (i + 0.5) * period
        feet = [0] if t < begin else ([0, 1] if t < end else [1])
        rows, bias = np.vstack([J[f] for f in feet]), np.concatenate([b[f] for f in feet])
        count = len(rows)
        before = q + moved[-N:]
        right = np.concatenate([-h, -bias])
        right[NV - N : NV] += K * (motor[:, 0] - before)
        full = np.block([[M, -rows.T], [rows, np.zeros((count, count))]])
        v += period * np.linalg.solve(full, right)[:NV]
        moved += period * v
        command = [u for at, u in sent if at <= t][-1]
        force = command + K * before
        state = np.column_stack([motor, force, K * v[-N:]])
        motor = np.einsum("jrk,jk->jr", table, state)
    return moved, v, motor


@pytest.mark.parametrize(("begin", "end"), [(-1.0, -0.5), (0.004, 0.009), (1.0, 2.0)])
def test_prediction_against_its_plain_twin(hume, terms, begin, end):
    """Support before, within and after the weight transfer; commands arrive one after another."""
    M, h, J, b, rng = terms
    q, v, motor = rng.standard_normal(NV + 1), rng.standard_normal(NV), rng.standard_normal((N, 2))
    K = np.full(N, 350.0)
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = -350.0 / 0.05, -100.0 / 0.05, 1.0 / 0.05, 0.0
    table = np.tile(expm(A * 1e-3)[:2], (N, 1, 1))
    arrival, command = np.full(8, -np.inf), np.zeros((8, N))
    sent = []
    for k in range(11):
        place = k % 8
        arrival[place], command[place] = 0.002 * (k - 4), rng.standard_normal(N)
        sent.append((arrival[place], command[place].copy()))
    expected = plain_predict(
        M, h, J, b, q[-N:], v, motor, K, table, start=0.0, period=1e-3, ticks=15, sent=sent,
        begin=begin, end=end,
    )  # fmt: skip
    robot, _, _, _ = hume
    biped = biped_of(
        robot, q, v, springs=SPRINGS._replace(stiffness=K, table=table), motor=motor.copy(),
        flight=walking_law.Flight(arrival, command),
    )  # fmt: skip
    timing = walking_state.Timing(
        measured=0.0, period=1e-3, ticks=15, touchdown=begin, lift_off=end, stance=0, foot=-1,
        newest=10 % 8,
    )  # fmt: skip
    predict(walking_state.Links(M, h, J, b), biped, timing)
    for got, wanted in zip((biped.scratch.moved, biped.v, biped.motor), expected, strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_foothold_against_its_plain_twin(side):
    """The averaged end of the step; ξ(T) = u + ξ_plan solved for u, within reach."""
    height = np.array([0.88, 0.1, 0.0, 0.0, 0.0, 0.0])
    old, new, com = np.array([-0.2, 0.2, 0.0]), np.zeros(3), np.array([-0.05, 0.1, 0.9])
    speed, momentum = np.array([0.5, -0.1, 0.0]), np.array([0.02, -0.01])
    gait = walking.Gait(
        step_time=0.35, transfer_time=0.06, rate=3.4, growth=3.3, carried=1.4, end_outward=0.1,
        nearest=-0.15, farthest=0.55, narrowest=0.12, widest=0.5,
    )  # fmt: skip
    step = walking.StepNow(
        old=old, new=new, height=height, offset=0.02, phase=0.1, side=side, end_forward=0.2
    )
    memory = np.array([[0.1, 0.05], [0.6, 0.2]])
    x, v = com[:2].copy(), speed[:2] + momentum
    pendulum(x, v, 0.1, 0.35, 0.06, old, new, height, 0.02, 16)
    end = memory + 0.3 * (np.array([x, v]) - memory)
    u = (3.3 * (end[0] + end[1] / 3.4) - [0.2, -side * 0.1]) / (3.3 - 1.4)
    place = walking.capture_end(com, speed, momentum, tuple(step), tuple(gait), 0.3, memory)
    np.testing.assert_allclose(memory, end)
    np.testing.assert_allclose(
        place, [np.clip(u[0], -0.15, 0.55), side * np.clip(side * u[1], 0.12, 0.5)]
    )


def test_swing_moves_along_the_quintics_and_lands():
    """From rest to rest at the target, clear of the ground, derivatives by differences."""
    plan, target = (0.35, 0.06, 0.93, 0.3), np.array([0.4, -0.1, 0.03])
    now, rows = np.zeros((3, 3)), []
    for i in range(60, 351):
        walking.swing(now, target, i * 1e-3, 1e-3, plan, 0.0, 0.08)
        rows.append(now.copy())
    path = np.array(rows)
    np.testing.assert_allclose(path[-2, 0], target, atol=1e-3)
    assert path[:, 0, 2].max() > 0.08
    rate = (path[2:, 0] - path[:-2, 0]) / 2e-3
    np.testing.assert_allclose(rate[:250], path[1:-1, 1][:250], atol=0.02)
    np.testing.assert_allclose(path[-1, 1], [0.0, 0.0, -0.3])


@pytest.fixture(scope="module")
def hume():
    """Robot, its feet's mounts, and a workspace at a random state."""
    robot, rng = load_robot("bundled:hume.urdf", floating_base=True), np.random.default_rng(7)
    q = robot.configuration(
        np.deg2rad([3, -25, 55, -2, -35, 60]), base_position=rng.normal(size=3),
        base_quaternion=[0.02, 0.05, 0.3, 1.0],
    )  # fmt: skip
    v, at = 0.5 * rng.normal(size=NV), robot.workspace()
    at.update(q, v)
    return robot, q, v, at


@pytest.mark.parametrize("foot", [0, 1])
def test_odometry_is_an_evaluation_at_the_corrected_state(hume, foot):
    """The boosted terms are those that Pinocchio finds at the corrected place and velocity."""
    robot, q, v, _ = hume
    biped = biped_of(robot, q, v, anchor=np.ones((2, 3)))
    stand(biped, foot)
    there, rate, anchor = biped.q, biped.v, biped.anchor
    plain = robot.workspace()
    plain.update(there, rate)
    np.testing.assert_allclose(plain.frame_placement(FEET[foot])[1], anchor[foot], atol=1e-12)
    np.testing.assert_allclose(plain.frame_velocity(FEET[foot])[:3], 0.0, atol=1e-12)
    np.testing.assert_allclose(there[3:], q[3:])
    np.testing.assert_allclose(rate[3:], v[3:])
    np.testing.assert_allclose(biped.scratch.h, plain.nle, atol=1e-11)
    for f, name in enumerate(FEET):
        np.testing.assert_allclose(biped.feet.J[f], plain.frame_jacobian(name), atol=1e-13)
        np.testing.assert_allclose(biped.feet.drift[f, :3], plain.frame_bias(name)[:3], atol=1e-12)


def test_extrapolation_and_springs(hume):
    """Without commands in flight v is extrapolated; the springs follow from motors and links."""
    robot, q, v, _ = hume
    biped = biped_of(robot, q, v, motor=np.column_stack([q[-N:] + 0.1, v[-N:]]))
    timing = walking_state.Timing(
        measured=0.0, period=1e-3, ticks=-20, touchdown=0.0, lift_off=0.0, stance=0, foot=-1,
        newest=0,
    )  # fmt: skip
    walking_state.foresee(keep(biped), tuple(timing))
    expected = robot.integrate(q, 0.02 * v)
    np.testing.assert_allclose(biped.q, expected, atol=1e-12)
    np.testing.assert_allclose(biped.tau_sea, 350.0 * (biped.motor[:, 0] - expected[-N:]))
    there = robot.nonlinear_effects(biped.q, biped.v)
    np.testing.assert_allclose(biped.terms.nle, there, atol=1e-12)


@pytest.mark.parametrize("phase", [0.02, 0.2])
def test_law_against_its_plain_twin(hume, phase):
    """Task accelerations of one foot, or the blend of both feet's; planned joint rates."""
    robot, q, v, at = hume
    rng = np.random.default_rng(8)
    height, swing = np.array([0.9, 0.1, 0.2, 0.0, 0.0, 0.0]), rng.normal(size=(3, 3))
    transfer = 0.06
    com = at.com, at.com_velocity, at.com_bias(), at.com_jacobian()
    wish = walking_law.Reference(
        height=height, height_time=0.1, swing=swing, phase=phase, transfer_time=transfer, stance=0,
        still=False,
    )  # fmt: skip
    biped = biped_of(robot, q, v)
    assert law(biped, wish)
    tau, rates = biped.tau, biped.rates
    z = 0.9 + 0.01 + 0.002, 0.1 + 0.04, 0.4
    R = at.terms.rotation[1]
    yaw = np.arctan2(R[1, 0], R[0, 0])
    heading = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
    spin = np.zeros((3, NV))
    spin[:, 3:6] = R
    roll, pitch = np.arctan2(R[2, 1], R[2, 2]), np.arcsin(-R[2, 0])
    J = [at.frame_jacobian(f)[:3] for f in FEET]
    b = [at.frame_bias(f)[:3] for f in FEET]
    error, slip = swing[0] - at.frame_placement(FEET[1])[1], swing[1] - J[1] @ v
    wanted = np.zeros(N)
    wanted[0] = 0.8 * z[2] + 100 * (z[0] - at.com[2]) + 10 * (z[1] - at.com_velocity[2])
    wanted[1:3] = -110 * np.array([roll, pitch]) - 11 * (heading @ spin @ v)
    if phase > transfer:
        wanted[3:] = 0.8 * swing[2] + 400 * error + 20 * slip

    def support(stance):
        rows = np.vstack([com[3][2], heading @ spin, J[1 - stance]])
        full = np.block([[at.M, -J[stance].T], [J[stance], np.zeros((3, 3))]])
        X = np.linalg.solve(full, np.vstack([np.eye(NV)[:, -N:], np.zeros((3, N))]))[:NV]
        free = np.linalg.solve(full, np.concatenate([-at.nle, -b[stance]]))[:NV]
        drift = np.concatenate([com[2][2:], np.zeros(2), b[1 - stance]])
        return np.linalg.solve(rows @ X, wanted - drift - rows @ free)

    def couple(turn):
        """Torque of both feet: nothing but the yaw accelerates; the line through the feet stays."""
        feet = np.vstack(J)
        full = np.block([[at.M, -feet.T], [feet, np.zeros((6, 6))]])
        X = np.linalg.solve(full, np.vstack([np.eye(NV)[:, -N:], np.zeros((6, N))]))[:NV]
        rows = np.vstack([com[3][2], heading @ spin, com[3][:2], spin[2]])
        return np.linalg.lstsq(rows @ X, turn * np.eye(N)[5], rcond=1e-8)[0]

    share = min(phase / transfer, 1.0)
    plain = share * support(0) + (1 - share) * support(1)
    if phase < transfer:
        plain += couple(4 * share * (1 - share) * np.clip(-7 * yaw - 5 * spin[2] @ v, -10, 10))
    np.testing.assert_allclose(tau, plain, rtol=1e-5, atol=1e-4)
    rows = np.vstack([J[0], com[3][2], heading @ spin, J[1], com[3][:2], spin[2]])
    speed = np.zeros(12)
    speed[3], speed[9:11], speed[11] = z[1], com[1][:2], spin[2] @ v
    if phase > transfer:
        speed[6:9] = swing[1] + 10.0 * error
    np.testing.assert_allclose(rates, np.linalg.solve(rows, speed)[6:], rtol=1e-4, atol=1e-5)


def test_command_against_its_plain_twin(hume):
    """Limits, lead, velocity feedforward and torque feedback, each as it is written."""
    rng = np.random.default_rng(9)
    tau, smooth, rates, sea, D, ratio = rng.normal(size=(6, N))
    limit, command = np.full(N, 0.8), np.zeros(N)
    clipped = np.clip(tau, -0.8, 0.8)
    average = clipped + 0.7 * (smooth - clipped)
    plain = average + ratio * (clipped - average) / 5e-3 + D * rates + 0.5 * (clipped - sea)
    robot, q, v, _ = hume
    springs = SPRINGS._replace(damping=D.copy(), lag=ratio.copy(), limit=limit)
    biped = biped_of(
        robot, q, v, springs=springs, tau=tau.copy(), smooth=smooth.copy(), rates=rates.copy(),
        tau_sea=sea.copy(),
    )  # fmt: skip
    carry(biped, False, command)
    smooth = biped.smooth
    np.testing.assert_allclose(command, plain)
    np.testing.assert_allclose(smooth, average)
    plain_lead = LEAD._replace(time=0.0, forward=0.0, feedback=0.0)
    carry(biped._replace(lead=plain_lead), False, command)
    np.testing.assert_allclose(command, clipped)
