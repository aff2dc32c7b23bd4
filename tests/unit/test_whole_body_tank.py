"""The energy tank: never overdrawn, exact in energy, passive with the flow that pays for all."""

import numpy as np
import pytest
from scipy.linalg import expm

from helpers.chains import planar_arm, wheel
from sealag.actuation import Actuators
from sealag.whole_body import (
    Controller,
    GravityCompensation,
    Law,
    Measurement,
    StiffnessForm,
    Tank,
    TankFlow,
    Task,
    TaskKind,
)

STEP = 1e-3
M, K, B_S, D, K_Q = 1.0, 350.0, 0.09, 10.0, 100.0
BOUND = D / K_Q  # 1 / w with J*: the tank's x̂ is as soft as the motor angle


class Posed:
    """Three joints held by one posture task of a given stiffness, through the tick that runs.

    J* = I and τ_osc = S (x_d − x̂), so that the command shows x̂, and q̄(θ) has a closed form.
    """

    def __init__(self, folder, S, *, delay_bound=0.05, start=None, **options):
        arm = planar_arm(folder, count=3, mass=1.0, inertia=0.05, length=0.4)
        drives = Actuators.of(arm.joints, spring_stiffness=K, rotor_inertia=0.1, motor_damping=10.0)
        task = Task(name="posture", kind=TaskKind.POSTURE, stiffness=S)
        law = Law(
            tasks=(task,),
            signal=Tank(**options),
            gravity=GravityCompensation.NONE,
            stiffness_form=StiffnessForm.FORCE,
            velocity_feedforward=False,
        )
        self.wanted, self.t, self.S = np.zeros(3), 0.0, S
        self._controller = Controller(
            arm, law, drives, posture=np.zeros(3), delay_bound=delay_bound,
            reference=lambda t: (self.wanted, np.zeros(3)),
        )  # fmt: skip
        self._seen, self._out = Measurement.allocate(nq=3, nv=3, n=3), np.zeros(3)
        self.reset()
        self.tick(0.0, np.zeros(3))

    def reset(self):
        """Start a run."""
        self._controller.reset(0.0, self._seen)

    def tick(self, period, moved):
        """Move the motors and run one tick."""
        self.t += period
        self._seen.theta[:] += moved
        self._controller.tick(self.t, self._seen, self._out)
        self.x_hat = self.wanted - np.linalg.solve(self.S, self._out)

    @property
    def target(self):
        """q̄ of K (θ − q̄) = S (x_d − q̄)."""
        load = K * self._seen.theta - self.S @ self.wanted
        return np.linalg.solve(K * np.eye(3) - self.S, load)

    @property
    def energy(self):
        return self._controller.tank_energy


def stiffness(rng):
    X = rng.normal(size=(3, 3))
    return 5.0 * (X @ X.T + np.eye(3))


def ticks(rng, count):
    """Periods, moves of the motors and references, as a rough run would give them."""
    for _ in range(count):
        yield rng.choice([0.0, 1e-3, 0.05]), 0.05 * rng.normal(size=3), rng.normal(size=3)


@pytest.mark.parametrize("flow", list(TankFlow))
@pytest.mark.parametrize("seed", range(5))
def test_tank_is_never_overdrawn_and_an_empty_one_does_nothing(flow, seed, tmp_path):
    rng = np.random.default_rng(seed)
    S, idle = stiffness(rng), 0
    full = Posed(tmp_path, S, energy=0.2, flow=flow)
    for period, moved, full.wanted in ticks(rng, 400):
        before = full.x_hat
        full.tick(period, moved)
        assert full.energy >= 0.0
        idle += np.allclose(full.x_hat, before + moved, rtol=0.0, atol=1e-12)
    assert 0 < idle < 400, "it should have paid for some steps and refused others"
    empty, moved = Posed(tmp_path, S, energy=0.0, flow=flow), np.array([0.1, -0.2, 0.3])
    # q̄ lies further from x_d than θ: u would load the task's spring, and there is nothing to pay.
    empty.tick(1e-3, moved)
    assert np.linalg.norm(empty.target) > 1.01 * np.linalg.norm(moved)
    assert empty.energy == 0.0
    np.testing.assert_allclose(empty.x_hat, moved, rtol=0.0, atol=1e-12)


def test_a_reset_fills_the_tank_again(tmp_path):
    """A controller that has run once starts its next run with all of its energy."""
    rng = np.random.default_rng(3)
    one = Posed(tmp_path, stiffness(rng), energy=0.7, flow=TankFlow.CORRECTED)
    for period, moved, one.wanted in ticks(rng, 20):
        one.tick(period, moved)
    spent = 0.7 - one.energy
    assert abs(spent) > 0.05
    one.reset()
    assert one.energy == 0.7


@pytest.mark.parametrize("flow", list(TankFlow))
def test_energy_is_what_the_step_costs_to_rounding(flow, tmp_path):
    """Corrected: what u does to V_3, and u's part of T ½ d̄ |x̂̇|²_S; published: the last alone."""
    rng, d = np.random.default_rng(7), 0.05
    S = stiffness(rng)
    one = Posed(tmp_path, S, delay_bound=d, energy=1e3, flow=flow)
    for period, moved, wanted in ticks(rng, 50):
        one.wanted = wanted
        before, energy = one.x_hat, one.energy
        one.tick(period, moved)
        if period == 0.0:
            continue
        u = (one.x_hat - before - moved) / period

        def V_3(x, wanted=wanted):
            return 0.5 * (wanted - x) @ S @ (wanted - x)

        half = before + 0.5 * (one.x_hat - before)
        spring = V_3(one.x_hat) - V_3(before) + (wanted - half) @ S @ moved
        rate = u + moved / period
        delay = 0.5 * d * period * (rate @ S @ rate - moved @ S @ moved / period**2)
        cost = delay + (spring if flow is TankFlow.CORRECTED else 0.0)
        assert one.energy - energy == pytest.approx(-cost, abs=1e-9)
        assert abs(spring) > 1e-9, "without work of u the two flows could not be told apart"


def test_x_hat_goes_to_its_target_however_long_the_period(tmp_path):
    S = stiffness(np.random.default_rng(1))
    for period in (1e-3, 0.1, 100.0):
        one = Posed(tmp_path, S, energy=1e6, rate=20.0)
        one.tick(0.0, np.full(3, 0.1))
        assert np.abs(one.x_hat - one.target).max() > 1e-3
        for _ in range(int(1.0 / period) + 1):
            one.tick(period, np.zeros(3))
        np.testing.assert_allclose(one.x_hat, one.target, atol=1e-6)


def simulate_one_joint(folder, flow, *, up=0.0, rate=20.0, duration=1.5, spring_work=True):
    """V_1 … V_4 + E of one joint on the total delay 0.999 / w, the part `up` of it in sensing.

    The plant is propagated exactly, the controller runs every millisecond. With old measurements
    x̂, u and E of a tick belong to the instant of measurement, so V takes them from `up` later.
    """
    robot = wheel(folder, inertia=M)
    motors = Actuators.of(robot.joints, spring_stiffness=K, rotor_inertia=B_S, motor_damping=D)
    task = Task(name="wheel", kind=TaskKind.POSTURE, stiffness=K_Q)
    d = 0.999 * BOUND
    law = Law(
        tasks=(task,),
        signal=Tank(rate=rate, flow=flow),
        gravity=GravityCompensation.NONE,
        stiffness_form=StiffnessForm.FORCE,
    )
    controller = Controller(robot, law, motors, posture=np.zeros(1), delay_bound=d)
    steps, whole = round(duration / STEP), int(d / STEP) - 1  # a held sample ages by one step more
    old = round(up * whole)
    A = np.array(
        [[0, 0, 1, 0], [0, 0, 0, 1], [-K / M, K / M, 0, 0], [K / B_S, -K / B_S, 0, -D / B_S]]
    )
    motion = expm(STEP * np.block([[A, np.array([[0], [0], [0], [1 / B_S]])], [np.zeros((1, 5))]]))
    state = np.zeros((steps + 1, 4))
    state[0, :2] = 0.3
    measured, out = Measurement.allocate(nq=1, nv=1, n=1), np.zeros(1)
    x_hat, energy, stored, commands = (np.zeros(steps) for _ in range(4))
    measured.q[:], measured.theta[:] = state[0, :2]
    controller.reset(0.0, measured)
    for i in range(steps):
        measured.q[0], measured.theta[0], measured.v[0], measured.theta_dot[0] = state[
            max(i - old, 0)
        ]
        controller.tick(i * STEP, measured, out)
        commands[i], x_hat[i] = out[0], -out[0] / K_Q
        energy[i] = controller.tank_energy
        stored[i] = controller.storage(i * STEP, measured, np.zeros(len(measured.theta)))
        acting = commands[max(i - (whole - old), 0)]
        state[i + 1] = (motion @ np.append(state[i], acting))[:4]
    np.testing.assert_allclose(stored, 0.5 * K_Q * x_hat**2 + energy, atol=1e-12)
    q, theta, v, theta_dot = state[: steps - old].T
    V_1_2 = 0.5 * (M * v**2 + K * (q - theta) ** 2 + B_S * theta_dot**2)
    window = round(d / STEP)
    power = K_Q * (np.diff(x_hat[old:], prepend=x_hat[old]) / STEP) ** 2
    ramp = (window - np.arange(window) - 0.5) * STEP
    V_4 = 0.5 * STEP * np.convolve(power, ramp)[: steps - old]
    return V_1_2 + stored[old:] + V_4, energy[old:]


@pytest.mark.parametrize("up", [0.0, 0.5])
def test_total_never_rises_at_the_bound_with_the_corrected_flow(tmp_path, up):
    V, energy = simulate_one_joint(tmp_path, TankFlow.CORRECTED, up=up)
    assert np.diff(V).max() <= 1e-9 * V[0]
    assert V[-1] < 0.5 * V[0]
    assert energy.min() >= 0.0
    assert energy.min() < 1e-2, "an unspent tank would have tried nothing"


@pytest.mark.parametrize("up", [0.0, 0.5])
def test_total_rises_at_the_bound_with_the_published_flow(tmp_path, up):
    V, energy = simulate_one_joint(tmp_path, TankFlow.PUBLISHED, up=up)
    climb = (V - np.minimum.accumulate(V)).max()
    assert climb > 0.05 * V[0]
    assert energy.min() >= 0.0


def test_total_never_rises_with_either_flow_where_u_is_zero(tmp_path):
    for flow in TankFlow:
        V, energy = simulate_one_joint(tmp_path, flow, rate=0.0)
        assert np.diff(V).max() <= 1e-9 * V[0]
        assert (energy == 1.0).all()


def arm_controller(folder, *, reference=None, rate, **options):
    arm = planar_arm(folder, count=2, mass=1.0, inertia=0.05, length=0.4)
    motors = Actuators.of(arm.joints, spring_stiffness=350.0, rotor_inertia=0.1, motor_damping=10.0)
    task = Task(name="posture", kind=TaskKind.POSTURE, stiffness=50.0)
    law = Law(
        tasks=(task,),
        signal=Tank(rate=rate),
        gravity=GravityCompensation.NONE,
        stiffness_form=StiffnessForm.FORCE,
        **options,
    )
    return Controller(arm, law, motors, posture=np.array([0.3, -0.5]), reference=reference)


def test_lost_and_uneven_samples_leave_no_drift_in_x_hat(tmp_path):
    """x̂ moves by J* Δθ between samples: with u = 0 the command is that of motor angles."""
    controller = arm_controller(tmp_path, rate=0.0)
    measured, out = Measurement.allocate(nq=2, nv=2, n=2), np.zeros(2)
    measured.q[:] = measured.theta[:] = [0.3, -0.5]
    controller.reset(0.0, measured)
    controller.tick(0.0, measured, out)
    rng, t = np.random.default_rng(1), 0.0
    for _ in range(100):
        t += rng.uniform(0.0, 0.02)
        if rng.random() < 0.5:
            measured.theta[:] += rng.normal(scale=0.02, size=2)
            measured.theta_dot[:] = rng.normal(size=2)  # says nothing of Δθ, as a late sample's
        controller.tick(t, measured, out)
    expected = 50.0 * (np.array([0.3, -0.5]) - measured.theta)
    np.testing.assert_allclose(out, expected, atol=1e-10)
    assert np.abs(expected).max() > 1.0


def test_reference_moves_the_goal_and_not_x_hat(tmp_path):
    controller = arm_controller(
        tmp_path,
        reference=lambda t: (np.full(2, 0.1 * t), np.full(2, 0.1)),
        rate=0.0,
        velocity_feedforward=False,
    )
    measured, out = Measurement.allocate(nq=2, nv=2, n=2), np.zeros(2)
    measured.q[:] = measured.theta[:] = [0.3, -0.5]
    controller.reset(0.0, measured)
    controller.tick(0.0, measured, out)
    np.testing.assert_allclose(out, 0.0, atol=1e-12)
    controller.tick(1.0, measured, out)
    np.testing.assert_allclose(out, 50.0 * 0.1, atol=1e-10)
