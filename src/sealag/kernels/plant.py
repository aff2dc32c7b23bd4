"""Plant kernel: the fourth-order Runge-Kutta step of links, motors and contacts."""

import numpy as np
from numba import njit

from sealag.kernels import motor, rigid
from sealag.kernels.contact import evaluate, example, motion


@njit(cache=True)
def memory_size(nv, n):
    """Return how many numbers `shared` divides."""
    return 8 * nv + 24 + 4 * n + nv + 8 * n


@njit(cache=True)
def shared(memory, nv, n):
    """Return the named parts of a step's memory.

    Rates (4, nv), accelerations (4, nv) and powers (4, 6) of the stages, motor angles and speeds
    half a step and a step ahead (n, 2, 2), a displacement (nv,), and the joints' works (n, 8).
    """
    ends = 8 * nv + 24, 8 * nv + 24 + 4 * n, 9 * nv + 24 + 4 * n
    return (
        memory[: 4 * nv].reshape(4, nv), memory[4 * nv : 8 * nv].reshape(4, nv),
        memory[8 * nv : ends[0]].reshape(4, 6), memory[ends[0] : ends[1]].reshape(n, 2, 2),
        memory[ends[1] : ends[2]], memory[ends[2] :].reshape(n, 8),
    )  # fmt: skip


@njit(cache=True)
def advance(
    tree, terms, around, state, rates, now, stage, following, sizes, memory, motors, step, regular
):
    """Do a step in the present contact modes.

    Args:
        tree: the robot, as `sealag.robot.Robot.tree`.
        terms: its terms, as ``dynamics.allocate`` returns them; scratch.
        around: what surrounds the robot, as in ``contact.evaluate``.
        state: closed and yielding (P,).
        rates: stabilisation rate 1/s, time in which friction may stop a point s.
        now: memory of the step's beginning, as in ``contact.parts``, evaluated.
        stage: memory of the stages; scratch.
        following: memory of the step's end, written.
        sizes: as in ``contact.parts``.
        memory: as in `shared`, written.
        motors: parameters, whether torque feedback is not delayed (1.0), command (n,) and known
            spring torque (n,), and the tables over half a step, a step, and of works.
        step: s.
        regular: whether the step is as long as the tables' one; its works are then written.

    Returns:
        Whether every instant has a solution.
    """
    q, v, z, acceleration, power = motion(now, sizes)
    n = z.shape[0]
    parts = shared(memory, v.size, n)
    speeds, accelerations, powers, ahead, u, _ = parts
    _predict_motors(q, v, z, acceleration, motors, step, regular, motion(following, sizes)[2],
                    ahead)  # fmt: skip
    there_q, there_v, there_z, there_acceleration, there_power = motion(stage, sizes)
    speeds[0], accelerations[0], powers[0] = v, acceleration, power
    for k in range(1, 4):
        rigid.stage(
            q, v, speeds[k - 1], accelerations[k - 1], step if k == 3 else 0.5 * step, v.size - n,
            u, there_q, there_v, speeds[k],
        )  # fmt: skip
        for i in range(n):
            there_z[i, 0], there_z[i, 1] = ahead[i, k // 3, 0], ahead[i, k // 3, 1]
        if not evaluate(tree, terms, around, state, rates, motors[0], stage, sizes):
            return False
        accelerations[k], powers[k] = there_acceleration, there_power
    _close(q, v, z, motion(following, sizes)[:3], parts, motors, step, regular, regular)
    return evaluate(tree, terms, around, state, rates, motors[0], following, sizes)


@njit(cache=True)
def book_step(now, following, sizes, memory, motors, step):
    """Move links and motors to the end of an irregular step once more, and write its works."""
    q, v, z = motion(now, sizes)[:3]
    parts = shared(memory, v.size, z.shape[0])
    _close(q, v, z, motion(following, sizes)[:3], parts, motors, step, False, True)


@njit(cache=True)
def _predict_motors(q, v, z, acceleration, motors, step, regular, ahead_z, ahead):
    """Write motor angles and speeds half a step and a step ahead, the links accelerating evenly."""
    parameters, instant, tau_osc, tau_measured, half, whole, _ = motors
    n = z.shape[0]
    first_q, first_v = q.size - n, v.size - n
    ahead_z[:] = z
    for i in range(n):
        ahead_z[i, 3], ahead_z[i, 4] = q[first_q + i], v[first_v + i]
        ahead_z[i, 5], ahead_z[i, 6] = acceleration[first_v + i], 0.0
    motor.predict(
        parameters, instant, tau_osc, tau_measured, ahead_z, step, half, whole, regular, ahead
    )


@njit(cache=True)
def _close(q, v, z, end, parts, motors, step, regular, book):
    """Move the links to the step's end, and the motors along the links' cubic; book if asked to."""
    parameters, instant, tau_osc, tau_measured, _, whole, forms = motors
    end_q, end_v, end_z = end
    n, work = z.shape[0], parts[5]
    base = v.size - n
    rigid.combine(q, v, parts[0], parts[1], step, base, end_q, end_v)
    end_z[:] = z
    motor.link_cubic(end_z, q[q.size - n :], v[base:], end_q[q.size - n :], end_v[base:], step)
    work[:] = 0.0
    if book:
        motor.add_link_work(end_z, step, work)
    motor.move(
        parameters, instant, tau_osc, tau_measured, end_z, step, whole, forms, regular, book, work
    )


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    tree, terms, around, state, rates, parameters, now, sizes = example()
    nv, n = 7, 1
    memory = np.zeros(memory_size(nv, n))
    shared(memory, nv, n)
    tables = (np.zeros((n, 4, 9, 9)), np.zeros((n, 4, 9, 9)), np.zeros((n, 4, 5, 9, 9)))
    motors = (parameters, 1.0, np.zeros(n), np.zeros(n), *tables)
    stage, following = now.copy(), now.copy()
    advance(
        tree, terms, around, state, rates, now, stage, following, sizes, memory, motors, 1e-3, True
    )
    book_step(now, following, sizes, memory, motors, 1e-3)
