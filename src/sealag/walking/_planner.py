"""Phase-space planning of a walk over rough terrain (docs/theory section 11).

Zhao, Sentis, Humanoids 2012; Zhao, Fernandez, Sentis, IJRR 2017.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from sealag.constants import GRAVITY
from sealag.errors import InputError
from sealag.robot import Motion, Robot
from sealag.typing import Array, ArrayLike
from sealag.walking._feet import Side
from sealag.walking._ground import Ground
from sealag.walking._motion import Targets, follow


@dataclass(frozen=True, slots=True, kw_only=True)
class Stance:
    """One support phase: a prismatic inverted pendulum over one foot.

    The centre of mass moves on the plane z = slope · (x − x_f) + z_f + height about the foot;
    x − x_f = (apex_speed / ω) sinh ω(t − apex_time).

    Attributes:
        side: which foot stands.
        foot: (3,) foothold, m.
        height: of the centre of mass above the foot at the apex, m.
        slope: dz/dx of the CoM plane.
        omega: √(g / height), 1/s.
        apex_time: when the centre of mass passes over the foot, s.
        apex_speed: forward speed then, m/s.
        apex_offset: y − y_f then, where the lateral speed is 0, m.
        start: begin of the phase, s.
        end: end of the phase, s.
    """

    side: Side
    foot: Array
    height: float
    slope: float
    omega: float
    apex_time: float
    apex_speed: float
    apex_offset: float
    start: float
    end: float

    def horizontal(self, t: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration (2,) of the CoM in x and y.

        Args:
            t: s, within the phase.
        """
        w = self.omega
        c, s = math.cosh(w * (t - self.apex_time)), math.sinh(w * (t - self.apex_time))
        offset = np.array([self.apex_speed / w * s, self.apex_offset * c])
        speed = np.array([self.apex_speed * c, self.apex_offset * w * s])
        return self.foot[:2] + offset, speed, w * w * offset


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkPlan:
    """A walk from the apex over the first foot to the apex over the last.

    Attributes:
        stances: the support phases; one more than steps.
        previous_foot: (3,) where the first swing foot left the ground, m.
        next_foot: (3,) where the last swing foot would land, m.
        ground: the ground.
    """

    stances: tuple[Stance, ...]
    previous_foot: Array
    next_foot: Array
    ground: Ground

    @classmethod
    def over(
        cls,
        ground: Ground,
        *,
        steps: int = 7,
        apex_speed: ArrayLike = 0.6,
        step_length: ArrayLike = 0.45,
        step_width: float = 0.2,
        com_height: ArrayLike = 0.86,
        first_side: Side = Side.RIGHT,
    ) -> Self:
        """Plan a walk: footholds on the ground, apexes over them, switches where phase curves meet.

        Stances k and k + 1 switch where v_k² + ω_k²(x − x_k)² = v_{k+1}² + ω_{k+1}²(x − x_{k+1})².
        The lateral foothold y_{k+1} = y_s + (ẏ_s / ω) coth(ω T) makes ẏ = 0 at the next apex.

        Args:
            ground: the ground.
            steps: number of steps, at least 1.
            apex_speed: forward speed over each foot, one number or steps + 1, m/s.
            step_length: forward distance of footholds, one number or one for each step, m.
            step_width: lateral distance of the first two footholds if the walk were even, m.
            com_height: of the centre of mass above each foot at its apex, one number or steps + 1,
                m.
            first_side: which foot stands first.

        Returns:
            The plan, which begins at time 0 at the apex over the first foot, at x = y_foot = 0.

        Raises:
            InputError: a number is out of range, or a step is so short or long for its speeds that
                its phase curves do not meet between the feet.
        """
        if steps < 1:
            raise InputError(f"A walk needs at least one step, not {steps}.")
        speeds = _numbers("apex_speed", apex_speed, steps + 1)
        heights = _numbers("com_height", com_height, steps + 1)
        lengths = _numbers("step_length", step_length, steps)
        width = float(_numbers("step_width", step_width, 1)[0])
        x = np.concatenate([[0.0], np.cumsum(lengths)])
        omegas = np.sqrt(GRAVITY / heights)
        after, before = _switches(x, speeds, omegas)
        width *= first_side.other.lateral
        y, offsets = _lateral(omegas, after, before, width=width)
        feet = _on_ground(ground, x, y, lengths, width=width)
        apexes = np.concatenate([[0.0], np.cumsum(after + before)])
        starts = np.concatenate([[0.0], apexes[1:] - before])
        ends = np.append(starts[1:], apexes[-1])
        stances = tuple(
            Stance(
                side=first_side if k % 2 == 0 else first_side.other,
                foot=feet[k + 1],
                height=float(heights[k]),
                slope=float((feet[k + 2][2] - feet[k][2]) / (feet[k + 2][0] - feet[k][0])),
                omega=float(omegas[k]),
                apex_time=float(apexes[k]),
                apex_speed=float(speeds[k]),
                apex_offset=float(offsets[k]),
                start=float(starts[k]),
                end=float(ends[k]),
            )
            for k in range(steps + 1)
        )
        return cls(stances=stances, previous_foot=feet[0], next_foot=feet[-1], ground=ground)

    @property
    def duration(self) -> float:
        """Length of the walk, s."""
        return self.stances[-1].end

    def index(self, t: float) -> int:
        """Return which stance holds at an instant.

        Args:
            t: s.
        """
        for k, stance in enumerate(self.stances):
            if t < stance.end:
                return k
        return len(self.stances) - 1

    def com(self, t: float) -> tuple[Array, Array]:
        """Return position and velocity (3,) of the centre of mass, continuous in t.

        The height passes each apex on its stance's plane, with that plane's vertical speed; in
        between it is the cubic of time that joins them.

        Args:
            t: s.
        """
        k = self.index(t)
        place, speed, _ = self.stances[k].horizontal(t)
        if t < self.stances[k].apex_time and k > 0:
            k -= 1
        if k + 1 < len(self.stances):
            z, vz = _cubic(self.stances[k], self.stances[k + 1], t)
        else:
            last = self.stances[k]
            z = last.foot[2] + last.height + last.slope * (place[0] - last.foot[0])
            vz = last.slope * speed[0]
        return np.append(place, z), np.append(speed, vz)

    def swing(self, t: float, *, clearance: float = 0.06) -> tuple[Array, Array]:
        """Return position and velocity (3,) of the swing foot; at rest where it leaves and lands.

        Args:
            t: s.
            clearance: height of the middle of the path above its ends' line and over the ground
                in between, m.
        """
        k = self.index(t)
        stance = self.stances[k]
        begin = self.stances[k - 1].foot if k > 0 else self.previous_foot
        end = self.stances[k + 1].foot if k + 1 < len(self.stances) else self.next_foot
        start, stop = stance.start, stance.end
        if k == 0:
            start = stop - 2.0 * (stop - stance.apex_time)
        if k + 1 == len(self.stances):
            stop = start + 2.0 * (stance.apex_time - start)
        u = min(max((t - start) / (stop - start), 0.0), 1.0)
        rate = 1.0 / (stop - start)
        blend = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        blend_rate = 30.0 * u * u * (1.0 - u) ** 2 * rate
        bump = 64.0 * (u * (1.0 - u)) ** 3
        bump_rate = 192.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u) * rate
        lift = clearance + self._obstacle(begin, end)
        place = begin + (end - begin) * blend
        speed = (end - begin) * blend_rate
        up = np.array([0.0, 0.0, lift])
        return place + bump * up, speed + bump_rate * up

    def motion(
        self,
        robot: Robot,
        *,
        rate: float = 1000.0,
        clearance: float = 0.06,
        feet: tuple[str, str] = ("left_foot", "right_foot"),
        base_frame: str = "torso",
    ) -> Motion:
        """Return the motion of a biped with three actuated joints a leg that walks so.

        At each instant the stance foot stands on its foothold, the swing foot and the centre of
        mass follow the plan and the base stays upright.

        Args:
            robot: a floating-base biped.
            rate: instants per second.
            clearance: of the swing foot, m.
            feet: frames of the left and the right foot.
            base_frame: the frame that stays upright.

        Returns:
            The motion; its contact sets are the stance foot alone.

        Raises:
            RobotError: a foothold is out of reach or a joint limit would be passed; the message
                names step and instant.
        """
        time = np.arange(int(self.duration * rate) + 1) / rate
        targets = [self._targets(t, clearance) for t in time]
        return follow(
            robot, time, targets, stances=len(self.stances), feet=feet, base_frame=base_frame
        )

    def _targets(self, t: float, clearance: float) -> Targets:
        k = self.index(t)
        com, com_rate = self.com(t)
        swing, swing_rate = self.swing(t, clearance=clearance)
        stance = self.stances[k]
        return Targets(
            stance=k,
            side=stance.side,
            stand=stance.foot,
            com=com,
            com_rate=com_rate,
            swing=swing,
            swing_rate=swing_rate,
        )

    def _obstacle(self, begin: Array, end: Array) -> float:
        """How much the ground rises above the straight line between two footholds."""
        highest = 0.0
        for u in np.linspace(0.05, 0.95, 19):
            blend = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
            x, y, line = begin + (end - begin) * blend
            bump = 64.0 * (u * (1.0 - u)) ** 3
            highest = max(highest, (self.ground.height(x, y) - line) / max(bump, 0.05))
        return highest


def _cubic(before: Stance, after: Stance, t: float) -> tuple[float, float]:
    """Height and vertical speed between two apexes."""
    T = after.apex_time - before.apex_time
    u = (t - before.apex_time) / T
    z0, z1 = before.foot[2] + before.height, after.foot[2] + after.height
    v0, v1 = before.slope * before.apex_speed * T, after.slope * after.apex_speed * T
    a, b = 2 * z0 - 2 * z1 + v0 + v1, -3 * z0 + 3 * z1 - 2 * v0 - v1
    return ((a * u + b) * u + v0) * u + z0, ((3 * a * u + 2 * b) * u + v0) / T


def _numbers(name: str, values: ArrayLike, count: int) -> Array:
    array = np.asarray(values, dtype=float)
    if array.ndim == 0:
        array = np.full(count, float(array))
    if array.shape != (count,):
        raise InputError(f"{name} has {array.size} values; one or {count} are right.")
    if not (np.isfinite(array).all() and (array > 0.0).all()):
        raise InputError(f"{name} must be positive and finite.")
    return array


def _switches(x: Array, v: Array, omega: Array) -> tuple[Array, Array]:
    """Times from each apex to the switch, and from there to the next apex (steps,) each."""
    after, before = [], []
    for k in range(len(x) - 1):
        w0, w1 = omega[k] ** 2, omega[k + 1] ** 2
        curve = np.array(
            [
                w0 - w1,
                -2.0 * (w0 * x[k] - w1 * x[k + 1]),
                v[k] ** 2 - v[k + 1] ** 2 + w0 * x[k] ** 2 - w1 * x[k + 1] ** 2,
            ]
        )
        roots = np.roots(np.trim_zeros(curve, "f"))
        between = [r.real for r in roots if abs(r.imag) < 1e-9 and x[k] < r.real < x[k + 1]]
        if not between:
            raise InputError(
                f"The phase curves of step {k + 1} do not meet between its feet: apex speeds "
                f"{v[k]:.2f} and {v[k + 1]:.2f} m/s are too different for a step of "
                f"{x[k + 1] - x[k]:.2f} m."
            )
        at = min(between, key=lambda r: abs(r - (x[k] + x[k + 1]) / 2.0))
        after.append(math.asinh(omega[k] * (at - x[k]) / v[k]) / omega[k])
        before.append(math.asinh(omega[k + 1] * (x[k + 1] - at) / v[k + 1]) / omega[k + 1])
    return np.array(after), np.array(before)


def _lateral(omega: Array, after: Array, before: Array, *, width: float) -> tuple[Array, Array]:
    """Lateral footholds and CoM offsets at the apexes such that ẏ = 0 there."""
    offset = width / 2.0 / math.cosh(omega[0] * after[0])
    y, offsets = [0.0], [offset]
    for k in range(len(after)):
        w0, w1 = omega[k], omega[k + 1]
        place = y[-1] + offset * math.cosh(w0 * after[k])
        speed = offset * w0 * math.sinh(w0 * after[k])
        y.append(place + speed / w1 / math.tanh(w1 * before[k]))
        offset = (place - y[-1]) * math.cosh(w1 * before[k]) + speed / w1 * math.sinh(
            w1 * before[k]
        )
        offsets.append(offset)
    return np.array(y), np.array(offsets)


def _on_ground(ground: Ground, x: Array, y: Array, lengths: Array, *, width: float) -> list[Array]:
    """The foot before the first, the feet of the walk, and the foot after the last."""
    side = width if len(x) % 2 else -width
    xs = [-lengths[0], *x, x[-1] + lengths[-1]]
    ys = [width, *y, y[-1] + side]
    return [np.array([a, b, ground.height(a, b)]) for a, b in zip(xs, ys, strict=True)]
