"""Walking kernels: quintic references, the pendulum under a planned height, foothold and swing."""

from typing import NamedTuple

import numpy as np

from sealag.constants import GRAVITY
from sealag.kernels._jit import entry, inner
from sealag.typing import Array


@entry
def quintic(start, end, duration, c):
    """Write the coefficients c (6,) of the quintic between two (position, rate, acceleration).

    Args:
        start: (3,) at time 0.
        end: (3,) at ``duration``.
        duration: s, positive.
        c: (6,) coefficients of t⁰ … t⁵, written.
    """
    T = duration
    c[0], c[1], c[2] = start[0], start[1], 0.5 * start[2]
    d0 = end[0] - start[0] - start[1] * T - 0.5 * start[2] * T * T
    d1 = end[1] - start[1] - start[2] * T
    d2 = end[2] - start[2]
    c[3] = (10.0 * d0 - 4.0 * d1 * T + 0.5 * d2 * T * T) / T**3
    c[4] = (-15.0 * d0 + 7.0 * d1 * T - d2 * T * T) / T**4
    c[5] = (6.0 * d0 - 3.0 * d1 * T + 0.5 * d2 * T * T) / T**5


@inner
def quintic_values(c, t):
    """Return position, rate and acceleration at t (s) of the quintic with coefficients c (6,)."""
    position = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    rate = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])))
    return position, rate, 2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5]))


@entry
def quintic_at(c, t, out):
    """Write position, rate and acceleration (3,) of a quintic at a time.

    Args:
        c: (6,) coefficients.
        t: s.
        out: (3,), written.
    """
    out[0], out[1], out[2] = quintic_values(c, t)


@inner
def pendulum(x, v, begin, end, transfer, old, new, height, offset, steps):
    """Move the pendulum's x, v (2,) in place from one phase of a step to another.

    The centre of pressure moves from the old to the new foot during the weight transfer; the
    height follows its plan, so ẍ = (g + z̈)(x − p)/(z − p_z).

    Args:
        x: (2,) horizontal position, m; moved.
        v: (2,) horizontal velocity, m/s; moved.
        begin: phase now, s.
        end: phase at the end, s.
        transfer: duration of the weight transfer from phase 0, s.
        old: (3,) foot left.
        new: (3,) foot stood on.
        height: (6,) quintic of the height over the world's zero.
        offset: phase at which the quintic's time is 0, s.
        steps: number of midpoint steps.
    """
    if end <= begin:
        return
    h = (end - begin) / steps
    for i in range(steps):
        t = begin + (i + 0.5) * h
        level, _, lift = quintic_values(height, t - offset)
        s = min(t / transfer, 1.0) if transfer > 0.0 else 1.0
        arm = max(level - old[2] - s * (new[2] - old[2]), 0.3)
        rate2 = max(GRAVITY + lift, 1.0) / arm
        for k in range(2):
            p = old[k] + s * (new[k] - old[k])
            a = rate2 * (x[k] + 0.5 * h * v[k] - p)
            x[k] += h * v[k] + 0.5 * h * h * a
            v[k] += h * a


class Gait(NamedTuple):
    """The periodic gait, and what the legs reach."""

    step_time: float  # s
    transfer_time: float  # of the weight, from phase 0, s
    rate: float  # ω of the pendulum, 1/s
    growth: float  # e = exp(ω T)
    carried: float  # κ, the part of it that the old foot still carries
    end_outward: float  # wanted capture point at the end of a step, from the foot stood on, m
    nearest: float  # bounds of the foothold from the foot stood on: forward, m
    farthest: float
    narrowest: float  # and outward, m
    widest: float


class StepNow(NamedTuple):
    """The step under way."""

    old: Array  # (3,) foot left, m
    new: Array  # (3,) foot stood on, m
    height: Array  # (6,) quintic of the height over the world's zero
    offset: float  # phase at which the quintic's time is 0, s
    phase: float  # now, s
    side: float  # sign of y from the foot stood on outward
    end_forward: float  # wanted capture point at its end, from the foot stood on, m


class SwingPlan(NamedTuple):
    """How the swing foot moves."""

    step_time: float  # s
    transfer_time: float  # s
    still: float  # share of the swing after which the foot no longer moves horizontally
    search: float  # speed at which a late foot is lowered, m/s


@entry
def capture_end(com, speed, momentum, raw_step, raw_gait, share, memory):
    """Average where the present step ends and write the foothold it asks for.

    Args:
        com: (3,) m.
        speed: (3,) of the CoM, m/s.
        momentum: (2,) what the angular momentum adds to the horizontal speed, m/s.
        raw_step: the step.
        raw_gait: the gait.
        share: of the new end in the average.
        memory: (2, 2) averaged position and speed at the end, moved.

    Returns:
        x and y of the foothold, m.
    """
    step, gait = StepNow(*raw_step), Gait(*raw_gait)
    new, side = step.new, step.side
    x, v = com[:2].copy(), speed[:2] + momentum
    pendulum(
        x, v, step.phase, gait.step_time, gait.transfer_time, step.old, new, step.height,
        step.offset, 16,
    )  # fmt: skip
    for k in range(2):
        memory[0, k] += share * (x[k] - memory[0, k])
        memory[1, k] += share * (v[k] - memory[1, k])
        capture = memory[0, k] + memory[1, k] / gait.rate - new[k]
        wanted = step.end_forward if k == 0 else -side * gait.end_outward
        x[k] = (gait.growth * capture - wanted) / (gait.growth - gait.carried)
    forward = min(max(x[0], gait.nearest), gait.farthest)
    outward = min(max(side * x[1], gait.narrowest), gait.widest)
    return new[0] + forward, new[1] + side * outward


@entry
def swing(now, target, phase, period, raw_plan, lift, bump):
    """Move the swing foot's reference by one period; late, lower it until it meets the ground.

    Args:
        now: (3, 3) position, velocity and acceleration one period ago, moved.
        target: (3,) where it shall land, m.
        phase: of the step, s.
        period: s.
        raw_plan: how the foot moves.
        lift: height at which it left the ground, m.
        bump: height of the middle of its path over the straight line, m.
    """
    plan = SwingPlan(*raw_plan)
    T, transfer = plan.step_time, plan.transfer_time
    duration = T - transfer
    left = transfer + plan.still * duration - phase
    c, end = np.empty(6), np.zeros(3)
    for i in range(2):
        if left > 0.015:
            end[0] = target[i]
            quintic(now[:, i], end, left, c)
            quintic_at(c, min(period, left), now[:, i])
        else:
            now[1, i], now[2, i] = 0.0, 0.0
    u = min(max((phase - transfer) / duration, 0.0), 1.0)
    w, rise = 1.0 - u, target[2] - lift
    if u >= 1.0:
        now[0, 2], now[1, 2], now[2, 2] = target[2] - plan.search * (phase - T), -plan.search, 0.0
        return
    now[0, 2] = lift + rise * u**3 * (10 - 15 * u + 6 * u * u) + 64 * bump * (u * w) ** 3
    rate = 30 * rise * (u * w) ** 2 + 192 * bump * (u * w) ** 2 * (w - u)
    bend = 60 * rise * u * w * (w - u) + 384 * bump * u * w * ((w - u) ** 2 - u * w)
    now[1, 2], now[2, 2] = rate / duration, bend / duration**2
