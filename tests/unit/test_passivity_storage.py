"""Stored energy falls below the bound and rises beyond it: docs/theory section 6, one joint.

V_1 … V_4 are the storage functions of the paper's Section IV-B, written out here.
"""

from dataclasses import replace

import numpy as np
import pytest

from helpers.chains import chain
from helpers.controllers import StoringPD
from helpers.levels import instant_bound
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.simulation import Network, closed_loop

K, B_S, D = 350.0, 0.09, 10.0
STEP = 1e-4


def link_storage(M, v, potential=0.0):
    """V_1 = ½ vᵀ M v + U_g."""
    return 0.5 * float(np.asarray(v) @ np.asarray(M) @ np.asarray(v)) + potential


def motor_storage(inertia, rate, stiffness, tau_sea):
    """V_2 = ½ θ̇ᵀ B_s θ̇ + ½ τ_seaᵀ K⁻¹ τ_sea."""
    torque = np.asarray(tau_sea)
    kinetic = np.sum(np.asarray(inertia) * np.square(rate))
    return 0.5 * float(kinetic + np.sum(torque**2 / np.asarray(stiffness)))


def task_storage(F, deviation):
    """V_3 = ½ δᵀ F δ."""
    return 0.5 * float(np.asarray(deviation) @ np.asarray(F) @ np.asarray(deviation))


def delay_storage(rate, Y, delay):
    """V_4 = 1/(2d) ∫_{t−d}^{t} (ξ − t + d) Y θ̇² dξ = (d P(t) − PP(t) + PP(t−d)) / 2d, P = ∫ Y θ̇²
    and PP = ∫ P by the trapezoidal rule."""

    def integral(values):
        steps = 0.5 * STEP * (values[1:] + values[:-1])
        return np.concatenate([[0.0], np.cumsum(steps)])

    lag, P = round(delay / STEP), integral(Y * rate**2)
    PP = integral(P)
    before = np.concatenate([np.zeros(lag), PP[:-lag]])
    return (delay * P - PP + before) / (2.0 * delay)


def run(M, F, delay, *, duration=6.0):
    """[q, θ, q̇, θ̇] under −F θ(t − d) from rest at a deflection; delay a whole number of steps."""
    lag = round(delay / STEP)
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 1.0
    A[2, :2] = -K / M, K / M
    A[3] = K / B_S, -K / B_S, 0.0, -D / B_S
    b = np.array([0.0, 0.0, 0.0, -F / B_S])
    x = np.array([0.3, 0.3, 0.0, 0.0])
    rows, theta = [x], [x[1]] * (lag + 1)
    for _ in range(round(duration / STEP)):
        old, new = theta[-lag - 1], theta[-lag] if lag else None
        mid = 0.5 * (old + new)

        def f(x, y):
            return A @ x + b * y

        k1 = f(x, old)
        k2 = f(x + STEP / 2 * k1, mid)
        k3 = f(x + STEP / 2 * k2, mid)
        k4 = f(x + STEP * k3, new)
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rows.append(x)
        theta.append(x[1])
    return np.array(rows)


def energy(M, F, delay, states):
    """V_1 + V_2 + V_3 + V_4, with a multiplier that proves the delay."""
    bound = replace(instant_bound([[F]], [D]), delay=np.array(delay))
    V_4 = delay_storage(states[:, 3], bound.prove().multiplier[0, 0], delay)
    others = [
        link_storage([[M]], [v])
        + motor_storage([B_S], [w], [K], [K * (theta - q)])
        + task_storage([[F]], [theta])
        for q, theta, v, w in states
    ]
    return np.array(others) + V_4


@pytest.mark.parametrize(("M", "F"), [(1.0, 100.0), (5.0, 300.0), (0.5, 30.0)])
def test_energy_never_rises_below_the_bound(M, F):
    bound = float(instant_bound([[F]], [D]).delay)
    delay = np.floor(0.999 * bound / STEP) * STEP
    total = energy(M, F, delay, run(M, F, delay))
    assert np.diff(total).max() < 1e-6 * total[0]
    assert total[-1] < 0.7 * total[0]


def test_energy_rises_where_the_published_bound_is_unsafe():
    """q̄(θ) is fed back: the motor sees K_θ, (29) allows 0.1 s, the margin is 0.0773 s."""
    M, K_q = 1.0, 100.0
    K_theta = 1.0 / (1.0 / K_q - 1.0 / K)
    states = run(M, K_theta, 0.095)
    total = [
        link_storage([[M]], [v])
        + motor_storage([B_S], [w], [K], [K * (theta - q)])
        + task_storage([[K_theta]], [theta])
        for q, theta, v, w in states
    ]
    assert max(total[len(total) // 2 :]) > 2.0 * total[0]


def test_the_audit_books_the_same_storage_functions(tmp_path):
    """V_1, V_2, V_3 of every logged instant, and S_j = V_1 + V_2 behind the joint side's slack."""
    robot = chain(tmp_path, count=2)
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=np.array([350.0, 200.0]),
        rotor_inertia=np.array([0.09, 0.04]),
        inertia_shaping=0.5,
        motor_damping=np.array([10.0, 6.0]),
    )
    F = 60.0
    run = closed_loop(
        robot,
        springs,
        StoringPD(np.zeros(2), stiffness=F, motor=True),
        q=np.array([0.4, -0.3]),
        theta=np.array([0.4, -0.3]),
        duration=0.3,
        network=Network(
            central_up=Link(delay=Constant(value=0.01)),
            central_down=Link(delay=Constant(value=0.02)),
            embedded_down=Link(delay=Constant(value=0.0)),
        ),
    )
    audit, K = run.audit, springs.spring_stiffness
    at, V_1 = robot.workspace(), []
    for q, v in zip(run.q, run.v):
        at.update(q, v)
        V_1.append(link_storage(robot.mass_matrix(q), v, at.potential_energy))
    books = audit.stores["kinetic"] + audit.stores["gravity"]
    np.testing.assert_allclose(V_1, books, rtol=1e-10, atol=1e-12)

    def V_2(inertia):
        rows = zip(run.theta_dot, run.tau_sea)
        return np.array([motor_storage(inertia, rate, K, tau) for rate, tau in rows])

    books = audit.stores["spring"] + audit.stores["motor"]
    physical = V_2(springs.rotor_inertia)
    np.testing.assert_allclose(physical, books, rtol=1e-10, atol=1e-12)
    V_3 = [task_storage(F * np.eye(2), theta) for theta in run.theta]
    np.testing.assert_allclose(V_3, audit.controller_storage, rtol=1e-10)

    drive = (audit.joint_flows["command"] - audit.joint_flows["damping"]).sum(axis=1)

    def slack(inertia):
        S_j = np.array(V_1) + V_2(inertia)
        return drive + audit.scalar_flows["disturbance"] - (S_j - S_j[0])

    np.testing.assert_allclose(slack(springs.shaped_inertia), audit.joint_side.slack, atol=1e-10)
    other = np.abs(slack(springs.rotor_inertia) - audit.joint_side.slack).max()
    assert other > 1e-3, "S_j holds the shaped inertia, not the rotor's own"
    assert np.ptp(audit.stores["gravity"]) > 0.1
