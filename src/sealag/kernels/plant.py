"""Plant kernel: the fourth-order Runge-Kutta step of links, motors and contacts between calls of
the robot's dynamics.
"""

import numpy as np
from numba import njit

from sealag.kernels import motor, rigid
from sealag.kernels.contact import example, motion


@njit(cache=True)
def advance(k, now, stage, following, sizes, memory, motors, step, regular, book):
    """Do what lies between two evaluations of the dynamics in a step.

    A step is four calls, k = 0 … 3, each but the last followed by the robot's terms and
    ``contact.evaluate`` of the stage. The first predicts the motors, the second to fourth keep
    what the stage was evaluated to; the first three move to the next stage, the last to the end.

    Args:
        k: number of the call.
        now: memory of the step's beginning, as in ``contact.parts``, evaluated.
        stage: memory of the stage, written; of z angles and speeds only.
        following: memory of the step's end, written: q, v and z.
        sizes: as in ``contact.parts``.
        memory: what the calls of a step share: rates (4, nv), accelerations (4, nv) and powers
            (4, 5) of the stages, motor angles and speeds half a step and a step ahead (n, 2, 2), a
            displacement (nv,) and the joints' works (n, 7).
        motors: parameters, whether torque feedback is not delayed (1.0), command (n,) and known
            spring torque (n,), and the tables over half a step, a step, and of works.
        step: s.
        regular: whether the step is as long as the tables' one.
        book: whether to write the works.
    """
    q, v, z, acceleration, power = motion(now, sizes)
    rates, accelerations, powers, ahead, u, _ = memory
    if k == 0:
        _predict_motors(q, v, z, acceleration, motors, step, regular, motion(following, sizes)[2],
                        ahead)  # fmt: skip
        rates[0], accelerations[0], powers[0] = v, acceleration, power
    else:
        accelerations[k], powers[k] = motion(stage, sizes)[3:]
    if k == 3:
        _close(q, v, z, motion(following, sizes)[:3], memory, motors, step, regular, book)
        return
    there_q, there_v, there_z = motion(stage, sizes)[:3]
    n = z.shape[0]
    rigid.stage(
        q, v, rates[k], accelerations[k], step if k == 2 else 0.5 * step, v.size - n, u, there_q,
        there_v, rates[k + 1],
    )  # fmt: skip
    for i in range(n):
        there_z[i, 0], there_z[i, 1] = ahead[i, k // 2, 0], ahead[i, k // 2, 1]


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
def _close(q, v, z, end, memory, motors, step, regular, book):
    """Move the links to the step's end, and the motors along the links' cubic; book if asked to."""
    parameters, instant, tau_osc, tau_measured, _, whole, forms = motors
    end_q, end_v, end_z = end
    n, work = z.shape[0], memory[5]
    base = v.size - n
    rigid.combine(q, v, memory[0], memory[1], step, base, end_q, end_v)
    end_z[:] = z
    motor.link_cubic(end_z, q[q.size - n :], v[base:], end_q[q.size - n :], end_v[base:], step)
    work[:] = 0.0
    motor.move(
        parameters, instant, tau_osc, tau_measured, end_z, step, whole, forms, regular, book, work
    )


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    _, _, _, _, parameters, now, sizes = example()
    nv, n = 7, 1
    memory = (
        np.zeros((4, nv)), np.zeros((4, nv)), np.zeros((4, 5)), np.zeros((n, 2, 2)), np.zeros(nv),
        np.zeros((n, 7)),
    )  # fmt: skip
    tables = (np.zeros((n, 4, 9, 9)), np.zeros((n, 4, 9, 9)), np.zeros((n, 4, 5, 9, 9)))
    motors = (parameters, 1.0, np.zeros(n), np.zeros(n), *tables)
    advance(0, now, now.copy(), now.copy(), sizes, memory, motors, 1e-3, True, True)
