"""The loop stepped in time: small motions about the equilibrium, the controller ticked as it runs.

It shares the plant's terms with `loop`, and nothing of the linearisation, the drive's matrices or
the roots: growth rates measured here check them.
"""

from collections import deque

import numpy as np

from oracle.black_box.box import BlackBox

AMPLITUDE = 1e-6
"""rad, m: of the push that starts the motion; velocities are too small for Coriolis forces."""


def deviation(
    black: BlackBox, *, delay: float, duration: float, step: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return times, s, and the motors' deviations from rest (steps, n), rad.

    Args:
        black: the design.
        delay: of the law's own path, s.
        duration: s.
        step: longest time step, s; the step divides the delay.
        seed: of the push.
    """
    body, d, rest = black.body, black.drive, black.rest()
    late = max(1, int(np.ceil(delay / step)))
    h = delay / late if delay > 0.0 else step
    e = black.design.torque_feedback_delay
    rng = np.random.default_rng(seed)
    Z = body.free(rest.q)
    rank = body.nv - Z.shape[1]
    place = slice(body.nq - body.n, body.nq)
    start = rest.torque.copy()
    q = body.move(rest.q, Z @ (AMPLITUDE * rng.normal(size=Z.shape[1])))
    state = np.concatenate([np.zeros(body.nv), rest.theta, np.zeros(body.n), start])
    black.law.reset(rest.q, rest.theta)
    hold = black.law.settled(rest.q, rest.theta)
    commands = deque([hold] * (late + 1), maxlen=late + 1)
    inner_late = max(1, round(e / h)) if e > 0.0 else 0
    springs = deque([start] * (inner_late + 1), maxlen=inner_late + 1)
    lagging = np.isfinite(d.bandwidth)
    rate = np.where(lagging, d.bandwidth, 0.0)

    def spring_of(q: np.ndarray, x: np.ndarray) -> np.ndarray:
        v, theta, omega, _ = np.split(x, cuts)
        return d.K * (theta - q[place]) + d.D_s * (omega - v[body.base :])

    def slope(q: np.ndarray, x: np.ndarray, u: np.ndarray, fed: np.ndarray | None) -> np.ndarray:
        v, _, omega, torque = np.split(x, cuts)
        spring = spring_of(q, x)
        force = -body.gravity(q) - body.damping @ v
        force[body.base :] += spring
        free = body.free(q, rank)
        accel = free @ np.linalg.solve(free.T @ body.mass(q) @ free, free.T @ force)
        inner = spring if fed is None else fed
        wanted = (u - d.D * omega) / d.beta + (1.0 - 1.0 / d.beta) * inner
        acting = np.where(lagging, torque, wanted)
        spin = (acting - spring - d.viscous * omega) / d.B
        return np.concatenate([accel, omega, spin, rate * (wanted - torque)])

    cuts = np.cumsum([body.nv, body.n, body.n])
    count = int(duration / h)
    times, out = h * np.arange(count), np.zeros((count, body.n))
    for k in range(count):
        out[k] = state[cuts[0] : cuts[1]] - rest.theta
        commands.append(black.law.tick(q, state[cuts[0] : cuts[1]], period=h))
        springs.append(spring_of(q, state))
        u = commands[0], 0.5 * (commands[0] + commands[1]), commands[1]
        fed = (None, None, None)
        if inner_late:
            fed = springs[0], 0.5 * (springs[0] + springs[1]), springs[1]
        a = slope(q, state, u[0], fed[0])
        va = state[: body.nv]
        xb = state + 0.5 * h * a
        b = slope(body.move(q, 0.5 * h * va), xb, u[1], fed[1])
        xc = state + 0.5 * h * b
        c = slope(body.move(q, 0.5 * h * xb[: body.nv]), xc, u[1], fed[1])
        xd = state + h * c
        f = slope(body.move(q, h * xc[: body.nv]), xd, u[2], fed[2])
        moved = (va + 2 * xb[: body.nv] + 2 * xc[: body.nv] + xd[: body.nv]) / 6.0
        q = body.move(q, h * moved)
        state = state + h / 6.0 * (a + 2 * b + 2 * c + f)
    return times, out


def growth(times: np.ndarray, out: np.ndarray) -> float:
    """Return the rate at which a motion grows, 1/s, between its second and last quarter.

    Args:
        times: s.
        out: (steps, n).
    """
    size = np.linalg.norm(out, axis=1)
    quarter = len(times) // 4
    early, last = size[quarter : 2 * quarter], size[3 * quarter :]
    gap = times[3 * quarter :].mean() - times[quarter : 2 * quarter].mean()
    return float(np.log(np.sqrt((last**2).mean()) / np.sqrt((early**2).mean())) / gap)
