"""The walking kernels against plain NumPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from sealag.kernels import walking

NV, N = 12, 6


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
    walking.pendulum(x, v, 0.0, 0.35, 0.06, old, new, height, 0.0, 16)
    np.testing.assert_allclose(np.concatenate([x, v]), exact, atol=2e-3)
    fine = np.array([-0.12, 0.11]), np.array([0.6, -0.2])
    walking.pendulum(*fine, 0.0, 0.35, 0.06, old, new, height, 0.0, 1600)
    np.testing.assert_allclose(np.concatenate(fine), exact, atol=1e-5)


def test_constrained_accelerations_solve_the_saddle_point(terms):
    """v̇ = a_0 + P τ equals the solution with contact forces written out."""
    M, h, J, b, rng = terms
    tau = rng.standard_normal(N)
    a_0, P = walking.constrain(np.linalg.inv(M), h, J[0], b[0], N)
    full = np.block([[M, -J[0].T], [J[0], np.zeros((3, 3))]])
    right = np.concatenate([-h, -b[0]])
    right[NV - N : NV] += tau
    np.testing.assert_allclose(a_0 + P @ tau, np.linalg.solve(full, right)[:NV], atol=1e-10)


def test_task_torques_give_the_accelerations_wanted(terms):
    """J_t v̇ + J̇_t v is what was asked for; near a singularity the torque stays bounded."""
    M, h, J, b, rng = terms
    J_t, b_t, wanted = rng.standard_normal((N, NV)), rng.standard_normal(N), rng.standard_normal(N)
    a_0, P = walking.constrain(np.linalg.inv(M), h, J[0], b[0], N)
    tau, a = walking.task_torques(a_0, P, J_t, b_t, wanted, 1e-14)
    np.testing.assert_allclose(J_t @ a + b_t, wanted, atol=1e-8)
    np.testing.assert_allclose(a, a_0 + P @ tau)
    J_t[5] = J_t[4]
    tau, _ = walking.task_torques(a_0, P, J_t, b_t, wanted, 1e-6)
    assert np.abs(tau).max() < 1e5


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
def test_prediction_against_its_plain_twin(terms, begin, end):
    """Support before, within and after the weight transfer; commands arrive one after another."""
    M, h, J, b, rng = terms
    q, v, motor = rng.standard_normal(N), rng.standard_normal(NV), rng.standard_normal((N, 2))
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
        M, h, J, b, q, v, motor, K, table, start=0.0, period=1e-3, ticks=15, sent=sent,
        begin=begin, end=end,
    )  # fmt: skip
    speed, drive = v.copy(), motor.copy()
    moved = walking.predict(
        M, h, J, b, q, speed, drive, K, table, 0.0, 1e-3, 15, arrival, command, 10 % 8, begin, end
    )
    for got, wanted in zip((moved, speed, drive), expected, strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)
