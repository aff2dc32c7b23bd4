"""What is certified is what runs: the controller's ticks against `Spaces` and its own storage."""

import gc
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from helpers.chains import planar_arm
from helpers.designs import EXAMPLES
from sealag.actuation import Actuators
from sealag.design import load
from sealag.errors import ContractionError, InputError, UnknownNameError
from sealag.robot import Contact
from sealag.whole_body import (
    Controller,
    GravityCompensation,
    Law,
    LinkAngles,
    Measurement,
    MotorAngles,
    Signal,
    Spaces,
    StaticJoint,
    StiffnessForm,
    Tank,
    Task,
    TaskError,
    TaskKind,
    TickController,
)

ANYMAL = load(EXAMPLES / "anymal.toml")
BAXTER = load(EXAMPLES / "baxter.toml")
HUME = load("bundled:hume")
ONE_FOOT = (Contact(frame="right_foot"),)
STANCES = {
    "baxter": (BAXTER, ()),
    "anymal": (ANYMAL, ANYMAL.contacts),
    "hume on one foot": (HUME, ONE_FOOT),
}
AGREE = 1e-6  # of the largest entry: rounding and truncation of two central differences


def settling(name):
    """A signal by its word, with enough iterations to settle in one tick."""
    signal = Signal.named(name)
    return (
        signal if isinstance(signal, MotorAngles | LinkAngles) else replace(signal, iterations=20)
    )


def running(system, changes):
    """The design's law, with motor angles and no compensation unless told otherwise."""
    return replace(system.law, **{"signal": MotorAngles(), "gravity": "none", **changes})


def build(system, contacts, *, motors=None, reference=None, delay_bound=0.0, **changes):
    return Controller(
        system.robot,
        running(system, changes),
        motors or system.actuators,
        contacts=tuple(contacts),
        posture=system.posture,
        delay_bound=delay_bound,
        reference=reference,
    )


def certified(system, contacts, **changes):
    design = replace(system, law=running(system, changes), contacts=tuple(contacts))
    return design.spaces()


def at_posture(system, *, torque=None):
    """The state at the posture, with motors ahead of the joints by what the springs carry."""
    robot = system.robot
    measured = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n)
    measured.q[:] = system.posture
    measured.theta[:] = robot.joint_positions(system.posture)
    if torque is not None:
        measured.theta[:] += torque / system.actuators.spring_stiffness
    return measured


def without_errors(system, controller, spaces):
    """The state whose fed-back configuration is the posture, where all task errors are 0."""
    law = controller.law
    at_q_bar = isinstance(law.signal, StaticJoint) or (
        isinstance(law.signal, Tank) and law.gravity is GravityCompensation.PLANNED
    )
    carried = at_q_bar and law.gravity is not GravityCompensation.NONE
    return at_posture(system, torque=spaces.gravity[0] if carried else None)


def without_task_error(controller):
    """Let x̂ of a tank be the posture's, where the tasks have no error; others have no memory."""
    tank = getattr(controller._signal, "_tank", None)
    if tank is not None:
        tank.position[:] = 0.0


def stiffness_that_runs(controller, measured, *, column=None, step=1e-5):
    """−∂(command)/∂θ, each column from a fresh start at the same state."""
    rest, n = measured.data.copy(), len(measured.theta)
    out, F = np.zeros(n), np.zeros((n, n))
    for j in range(n):
        for sign in (1.0, -1.0):
            measured.data[:] = rest
            controller.reset(0.0, measured)
            controller.tick(0.0, measured, out)
            without_task_error(controller)
            if column is None:
                measured.theta[j] += sign * step
            else:
                measured.q[:] = column(j, sign * step)
            controller.tick(0.0, measured, out)
            F[:, j] -= sign * out / (2.0 * step)
    measured.data[:] = rest
    return F


@pytest.mark.parametrize("form", list(StiffnessForm))
@pytest.mark.parametrize("gravity", list(GravityCompensation))
@pytest.mark.parametrize("signal", Signal.names())
@pytest.mark.parametrize("stance", STANCES)
def test_certified_stiffness_is_the_derivative_of_the_command(stance, signal, gravity, form):
    system, contacts = STANCES[stance]
    changes = {"stiffness_form": form, "signal": settling(signal), "gravity": gravity}
    spaces = certified(system, contacts, **changes)
    controller = build(system, contacts, **changes)
    measured, column = without_errors(system, controller, spaces), None
    if signal == "joint":
        # Link angles move with the base, as the contacts allow it.
        controller.reset(0.0, measured)
        along = controller._law.space.joint_from_base.copy()

        def column(j, step):
            return system.robot.integrate(system.posture, step * along[:, j])

    F = stiffness_that_runs(controller, measured, column=column)
    certain = spaces.F_theta[0]
    np.testing.assert_allclose(F, certain, atol=AGREE * np.abs(certain).max())
    if signal == "static_joint":
        assert np.abs(F - spaces.F_q[0]).max() > 0.05 * np.abs(certain).max(), "not that of x(θ)"


def test_plain_errors_of_lower_tasks_run_another_stiffness_than_the_certified():
    """The printed x̃_2 also answers to what task 1 moves: no potential, however symmetric S is."""
    spaces = certified(BAXTER, ())
    F = stiffness_that_runs(build(BAXTER, (), task_error=TaskError.PLAIN), at_posture(BAXTER))
    assert np.abs(F - spaces.F_theta[0]).max() > 0.02 * np.abs(F).max()
    assert Spaces.relative_asymmetry(F) > 1e-3
    first, S = spaces.levels[1], spaces.stiffness[0]
    alone = tuple(replace(t, priority=1) for t in BAXTER.law.tasks)
    J_all = certified(BAXTER, (), tasks=alone).J_star[0]
    J = spaces.J_star[0]
    expected = J[:first].T @ S[:first, :first] @ J[:first]
    expected += J[first:].T @ S[first:, first:] @ J_all[first:]
    np.testing.assert_allclose(F, expected, atol=AGREE * np.abs(F).max())
    plain = certified(BAXTER, (), task_error=TaskError.PLAIN)
    np.testing.assert_allclose(F, plain.F_theta[0], atol=AGREE * np.abs(F).max())
    assert plain.asymmetry[0] == pytest.approx(float(Spaces.relative_asymmetry(F)), rel=1e-3)


@pytest.mark.parametrize("contacts", [1, 2])
def test_one_level_runs_the_same_with_either_error(contacts):
    system = HUME if contacts == 1 else ANYMAL
    feet = ONE_FOOT if contacts == 1 else ANYMAL.contacts
    measured, out, plain = at_posture(system), np.zeros(system.robot.n), np.zeros(system.robot.n)
    measured.theta[:] += 0.05
    build(system, feet).tick(0.0, measured, out)
    build(system, feet, task_error=TaskError.PLAIN).tick(0.0, measured, plain)
    np.testing.assert_array_equal(out, plain)


def response_to_free_motions(system, contacts, **options):
    """−∂(command)/∂z (n, k) along motions Z (nv, k) that the contacts allow, with θ held; and Z."""
    robot = system.robot
    J_s = robot.contact_jacobian(contacts, system.posture)
    Z = np.linalg.svd(J_s)[2][np.linalg.matrix_rank(J_s) :].T
    controller, out = build(system, contacts, **options), np.zeros(robot.n)
    still = certified(system, contacts, **{k: options[k] for k in ("gravity",) if k in options})
    measured, response = without_errors(system, controller, still), np.zeros((robot.n, Z.shape[1]))
    rest = measured.data.copy()
    for j, z in enumerate(Z.T):
        for sign in (1.0, -1.0):
            measured.data[:] = rest
            controller.reset(0.0, measured)
            measured.q[:] = robot.integrate(system.posture, sign * 1e-5 * z)
            controller.tick(0.0, measured, out)
            response[:, j] -= sign * out / 2e-5
    return response, Z


def test_command_depends_on_motor_angles_alone_where_they_say_where_the_robot_is():
    """On four feet it does; on one foot three motions are passive, and x answers to them too."""
    assert np.linalg.norm(response_to_free_motions(ANYMAL, ANYMAL.contacts)[0], 2) < 1e-5
    assert np.linalg.norm(response_to_free_motions(HUME, ONE_FOOT)[0], 2) > 10.0


@pytest.mark.parametrize("gravity", list(GravityCompensation))
@pytest.mark.parametrize(("feet", "signal"), [(1, "motor"), (1, "static_joint"), (2, "motor")])
def test_derivative_contains_the_response_to_passive_motions(feet, signal, gravity):
    """One point foot leaves three passive motions, two leave one."""
    contacts = ONE_FOOT if feet == 1 else HUME.contacts
    law = {"signal": settling(signal), "gravity": gravity}
    response, Z = response_to_free_motions(HUME, contacts, **law)
    controller, spaces = build(HUME, contacts, **law), certified(HUME, contacts, **law)
    theta = without_errors(HUME, controller, spaces).theta
    found = controller._signal.derivative(HUME.posture, theta).C_q @ Z
    np.testing.assert_allclose(found, -response, atol=1e-5 * np.abs(response).max())
    assert np.abs(response).max() > 1.0


# The potential ---------------------------------------------------------------------------------
def stored(controller, measured, t=0.0):
    """V_3 and the tank; the command that comes with it is dropped."""
    return controller.storage(t, measured, np.zeros(len(measured.theta)))


def gradient(controller, measured, step=1e-4):
    found = np.zeros(len(measured.theta))
    for j in range(len(found)):
        for sign in (1.0, -1.0):
            measured.theta[j] += sign * step
            found[j] += sign * stored(controller, measured) / (2.0 * step)
            measured.theta[j] -= sign * step
    return found


@pytest.mark.parametrize("gravity", list(GravityCompensation))
@pytest.mark.parametrize("signal", [name for name in Signal.names() if name != "joint"])
@pytest.mark.parametrize("stance", STANCES)
def test_storage_is_the_potential_of_the_command(stance, signal, gravity):
    """To first order in the task error: what is left falls with its square."""
    system, contacts = STANCES[stance]
    controller = build(system, contacts, signal=settling(signal), gravity=gravity)
    spaces = certified(system, contacts, gravity=gravity)
    away = np.random.default_rng(2).normal(size=system.robot.n)
    rest, out = without_errors(system, controller, spaces), np.zeros(len(away))
    error, change = [], []
    for scale in (2e-3, 1e-3):
        measured = without_errors(system, controller, spaces)
        controller.reset(0.0, rest)
        controller.tick(0.0, rest, out)
        without_task_error(controller)
        still = out.copy()
        measured.theta[:] += scale * away
        for _ in range(3):  # the matrices of the fed-back configuration settle
            controller.tick(0.0, measured, out)
        error.append(np.abs(gradient(controller, measured) + out).max())
        change.append(np.abs(out - still).max())
    now = np.zeros_like(out)
    controller.storage(0.0, measured, now)
    np.testing.assert_allclose(now, out, atol=1e-6 * np.abs(out).max())
    if spaces.asymmetry[0] < 1e-8:
        assert error[1] < 0.02 * change[1]
        assert error[1] < 0.35 * error[0]
    else:  # compensation that presses the feet apart has no potential
        assert error[1] < 3.0 * spaces.asymmetry[0] * change[1]


def test_storage_of_motor_angles_is_not_that_of_the_static_joint_state():
    measured, out = at_posture(BAXTER), np.zeros(BAXTER.robot.n)
    measured.theta[:] += 1e-3
    static = build(BAXTER, (), signal=StaticJoint(iterations=20))
    static.reset(0.0, measured)
    static.tick(0.0, measured, out)
    right = np.abs(gradient(static, measured) + out).max()
    wrong = np.abs(gradient(build(BAXTER, ()), measured) + out).max()
    assert right < 0.005 * np.abs(out).max()
    assert wrong > 0.05 * np.abs(out).max()


def test_storage_and_tank_are_told_apart():
    controller = build(BAXTER, (), signal=Tank(energy=3.0))
    measured = at_posture(BAXTER)
    controller.reset(0.0, measured)
    controller.tick(0.0, measured, np.zeros(BAXTER.robot.n))
    assert controller.tank_energy == 3.0
    assert stored(controller, measured) == pytest.approx(3.0, abs=1e-12)
    motor = build(BAXTER, ())
    assert motor.tank_energy == 0.0
    assert stored(motor, measured) == pytest.approx(0.0, abs=1e-12)


# A driver's loop -------------------------------------------------------------------------------
def wander(system, ticks, seed=3):
    """Measurements of a robot that wanders about its posture."""
    rng, robot = np.random.default_rng(seed), system.robot
    measured = at_posture(system)
    for k in range(ticks):
        v = np.concatenate([np.zeros(robot.nv_base), 0.02 * rng.normal(size=robot.n)])
        measured.data[0] = 1e-3 * k
        measured.q[:] = robot.integrate(system.posture, v)
        measured.theta[:] = measured.q_joint + 0.01 * rng.normal(size=robot.n)
        measured.theta_dot[:] = rng.normal(size=robot.n)
        yield measured


@pytest.mark.parametrize("signal", Signal.names())
def test_reset_makes_runs_repeatable_and_storage_leaves_no_trace(signal):
    controller = build(ANYMAL, ANYMAL.contacts, signal=Signal.named(signal), delay_bound=0.01)

    def run(*, watched, again=True):
        commands = []
        for k, measured in enumerate(wander(ANYMAL, 30)):
            if k == 0 and again:
                controller.reset(0.0, measured)
            commands.append(np.zeros(ANYMAL.robot.n))
            controller.tick(1e-3 * k, measured, commands[-1])
            if watched:
                stored(controller, measured, 1e-3 * k)
        return np.array(commands)

    first = run(watched=False)
    np.testing.assert_array_equal(first, run(watched=True))
    assert np.abs(np.diff(first, axis=0)).max() > 0.1
    if signal in ("static_joint", "static_joint_tank"):
        assert not np.array_equal(first, run(watched=False, again=False)), "memory must show"


def test_it_is_a_controller_with_potential_and_tank_and_runs_without_the_simulator():
    controller: TickController = build(BAXTER, ())
    assert callable(controller.storage)
    assert controller.tank_energy == 0.0
    program = """
import sys, numpy as np
from sealag.actuation import Actuators
from sealag.robot import load_robot
from sealag.whole_body import Controller, Law, Measurement, Task, TaskKind
robot = load_robot("bundled:hume", floating_base=True)
motors = Actuators.of(robot.joints, spring_stiffness=350.0, rotor_inertia=0.1, motor_damping=10.0)
task = Task(name="com", kind=TaskKind.COM, stiffness=100.0)
posture = robot.configuration(np.full(robot.n, 0.2), base_position=(0, 0, 0.9))
controller = Controller(robot, Law(tasks=(task,)), motors, posture=posture)
measured = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n)
command = np.zeros(robot.n)
measured.q[:], measured.theta[:] = posture, 0.25
controller.reset(0.0, measured)
for k in range(100):
    controller.tick(1e-3 * k, measured, command)
assert np.isfinite(command).all() and np.abs(command).max() > 0.0
print(sorted(name for name in sys.modules if name.startswith("sealag.")))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert "sealag.whole_body" in done.stdout
    for room in ("simulation", "design", "passivity", "report", "cli"):
        assert f"'sealag.{room}'" not in done.stdout


class Leaking:
    """A controller that keeps every command."""

    def __init__(self, controller):
        self.controller, self.kept = controller, []

    def tick(self, t, measured, out):
        self.controller.tick(t, measured, out)
        self.kept.append(out.copy())


def growth(controller, robot, ticks):
    """Bytes that every block of ticks leaves behind: the least of five blocks.

    Python's cache of type attributes keeps the names that Numba looks up, up to 4096 of them; it
    fills in some blocks, a leak grows in all.
    """
    measured, out = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n), np.zeros(robot.n)
    gc.collect()
    tracemalloc.start()
    try:
        sizes = []
        for k in range(6 * ticks):
            measured.theta[:] = 0.1 * np.sin(0.01 * k)
            controller.tick(1e-3 * k, measured, out)
            if (k + 1) % ticks == 0:
                gc.collect()
                sizes.append(tracemalloc.get_traced_memory()[0])
        return min(np.diff(sizes))
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("signal", Signal.names())
def test_memory_stays_flat(tmp_path, signal):
    arm = planar_arm(tmp_path, count=2, mass=1.0, inertia=0.05, length=0.4)
    motors = Actuators.of(arm.joints, spring_stiffness=350.0, rotor_inertia=0.1, motor_damping=10.0)
    task = Task(name="end", kind=TaskKind.POSITION, frame="link1", axes=(0, 1), stiffness=20.0)
    law = Law(tasks=(task,), signal=Signal.named(signal))
    controller = Controller(arm, law, motors, posture=np.array([0.4, 0.6]))
    assert growth(controller, arm, 2_000) < 2_000  # less than a byte a tick
    if signal == "motor":
        assert growth(Leaking(controller), arm, 2_000) > 100_000


# Refusals and feedforward ----------------------------------------------------------------------
def test_wrong_postures_and_names_are_refused():
    for posture in (ANYMAL.posture[:-1], ANYMAL.posture[None], np.zeros(0)):
        with pytest.raises(InputError, match="posture has shape"):
            Controller(ANYMAL.robot, ANYMAL.law, ANYMAL.actuators, posture=posture)
    with pytest.raises(UnknownNameError, match="LF_FOOT"):
        build(ANYMAL, (Contact(frame="LF_FOOTT"),))
    build(ANYMAL, ANYMAL.contacts)


@pytest.mark.parametrize("signal", ["static_joint", "static_joint_tank"])
def test_too_soft_springs_are_refused_at_the_first_tick(signal):
    robot, measured, out = BAXTER.robot, at_posture(BAXTER), np.zeros(BAXTER.robot.n)
    factor = certified(BAXTER, ()).contraction[0] * BAXTER.actuators.spring_stiffness[0]
    for share, fails in ((1.01, False), (0.99, True)):
        motors = Actuators.of(
            robot.joints, spring_stiffness=share * factor, rotor_inertia=0.1, motor_damping=1.0
        )
        controller = build(BAXTER, (), motors=motors, signal=Signal.named(signal))
        controller.reset(0.0, measured)
        if fails:
            with pytest.raises(ContractionError, match="stiffer than the springs"):
                controller.tick(0.0, measured, out)
        else:
            controller.tick(0.0, measured, out)
            assert certified(replace(BAXTER, actuators=motors), ()).contraction == pytest.approx(
                1.0 / share, rel=1e-9
            )
        build(BAXTER, (), motors=motors).tick(0.0, measured, out)


def test_a_reference_out_of_reach_is_not_called_too_soft_springs():
    rows = BAXTER.law.levels(BAXTER.robot)[-1]

    def build_far(far):
        reference = lambda _t: (far * np.eye(rows)[0], np.zeros(rows))  # noqa: E731
        controller = build(BAXTER, (), signal=StaticJoint(), reference=reference)
        controller.reset(0.0, at_posture(BAXTER))
        return controller

    out = np.zeros(BAXTER.robot.n)
    build_far(1e-3).tick(0.0, at_posture(BAXTER), out)
    far = build_far(1e6)
    assert far._law.contraction < 1.0
    with pytest.raises(ContractionError, match=r"not found.*out of reach"):
        far.tick(0.0, at_posture(BAXTER), out)


def test_contraction_is_the_one_that_is_certified():
    for system, contacts in STANCES.values():
        controller, spaces = build(system, contacts), certified(system, contacts)
        assert controller._law.contraction == pytest.approx(spaces.contraction[0], rel=1e-9)


@pytest.mark.parametrize("stance", ["baxter", "anymal"])
def test_feedforward_is_the_damping_of_the_planned_motor_velocity(stance):
    """J* θ̇_d = ẋ_d on every level: motions that the joints can make come back as they are."""
    system, contacts = STANCES[stance]
    robot = system.robot
    J_s = robot.contact_jacobian(contacts, system.posture)
    wish = np.random.default_rng(4).normal(size=robot.nv)
    v = wish - np.linalg.pinv(J_s) @ J_s @ wish if len(J_s) else wish
    at = robot.workspace_at(system.posture)
    rate = np.vstack([row.take(at) for row in system.law.rows(robot)]) @ v
    commands = {}
    for wanted in (True, False):
        controller = build(
            system, contacts, velocity_feedforward=wanted,
            reference=lambda t: (np.zeros(len(rate)), rate),
        )  # fmt: skip
        commands[wanted] = np.zeros(robot.n)
        controller.tick(0.0, at_posture(system), commands[wanted])
    theta_dot = (commands[True] - commands[False]) / system.actuators.motor_damping
    np.testing.assert_allclose(controller._law.space.joint_from_base @ theta_dot, v, atol=1e-8)
    if stance == "baxter":
        np.testing.assert_allclose(theta_dot, v, atol=1e-8)
    np.testing.assert_allclose(commands[False], 0.0, atol=1e-9)


def test_reference_moves_the_equilibrium():
    """The offset of the references is a task error, seen in the command."""
    spaces = certified(ANYMAL, ANYMAL.contacts)
    offset = 0.01 * np.arange(1.0, 7.0)
    controller = build(ANYMAL, ANYMAL.contacts, reference=lambda t: (t * offset, np.zeros(6)))
    out = np.zeros(12)
    for t in (0.0, 2.0):
        controller.tick(t, at_posture(ANYMAL), out)
        expected = spaces.J_star[0].T @ spaces.stiffness[0] @ (t * offset)
        np.testing.assert_allclose(out, expected, atol=1e-8)
    assert np.abs(expected).max() > 0.1


def test_form_of_the_certified_task_is_the_law_s():
    """A tracked law is not changed by the controller that runs it."""
    controller = build(ANYMAL, ANYMAL.contacts, stiffness_form=StiffnessForm.FORCE)
    np.testing.assert_allclose(controller._law.space.stiffness, ANYMAL.law.gain(ANYMAL.robot))
    assert controller.law.stiffness_form is StiffnessForm.FORCE
    assert ANYMAL.law.stiffness_form is StiffnessForm.SYMMETRIC
