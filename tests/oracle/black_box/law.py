"""The law that runs: the controller's own tick as a function of a measurement, differentiated."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

import sealag
from oracle.black_box.body import Body
from sealag.whole_body import Measurement

PERIOD = 1e-3
"""s between the controller's ticks where only what it settles to counts."""
MOST_TICKS = 400
SETTLED = 3e-15
"""Relative change of a command that counts as none."""
ROUNDING = 1e-8
"""Relative change below which a command that comes no nearer is at its rounding."""
STEPS = (1e-3, 1e-4, 1e-5, 1e-6)
"""rad, m: largest steps of the difference quotients, tried until they agree to SMOOTH."""
SMOOTH = 1e-9
CORNERED = 1e-4
"""Share of a derivative by which a slope in a general direction may miss what the columns say."""


class Unsettled(RuntimeError):
    """The ticks do not converge for a constant measurement, or the law has no derivative."""


def controller_of(system, q: np.ndarray, contacts=None):
    """Return a design's controller that holds q: the one place that knows how sealag makes it.

    Args:
        system: as `sealag.load` returns it.
        q: (nq,) the posture.
        contacts: which frames are held; the system's own if None.
    """
    contacts = system.contacts if contacts is None else contacts
    system = replace(system, posture=q, contacts=contacts)
    return system.controller()


class Law:
    """τ_osc as a function of the measured q and θ, once its ticks have settled."""

    def __init__(self, body: Body, system, q: np.ndarray, K: np.ndarray, contacts=None) -> None:
        """Take the controller that holds q.

        Args:
            body: the robot.
            system: the design.
            q: (nq,) posture.
            K: (n,) spring stiffness, for the measured spring torque.
            contacts: held frames; the system's own if None.
        """
        self.controller = controller_of(system, q, contacts)
        self._body, self._K = body, K
        count = len(system.contacts if contacts is None else contacts)
        self._seen = Measurement.allocate(nq=body.nq, nv=body.nv, n=body.n, contacts=count)
        self._seen.contact[:] = 1.0
        self._time, self._out = 0.0, np.zeros(body.n)

    def _measure(self, q: np.ndarray, theta: np.ndarray) -> None:
        seen = self._seen
        seen.q[:], seen.theta[:] = q, theta
        seen.tau_sea[:] = self._K * (theta - q[len(q) - len(theta) :])

    def reset(self, q: np.ndarray, theta: np.ndarray) -> None:
        """Let the controller begin in this state."""
        self._measure(q, theta)
        self._time = 0.0
        self.controller.reset(0.0, self._seen)

    def tick(self, q: np.ndarray, theta: np.ndarray, *, period: float = PERIOD) -> np.ndarray:
        """Return the command of one tick, `period` after the last."""
        self._measure(q, theta)
        self._time += period
        self._seen.data[0] = self._time
        self.controller.tick(self._time, self._seen, self._out)
        return self._out.copy()

    def settled(self, q: np.ndarray, theta: np.ndarray, *, period: float = PERIOD) -> np.ndarray:
        """Return the command that ticks with the same measurement converge to."""
        last, change = self.tick(q, theta, period=period), np.inf
        for count in range(MOST_TICKS):
            out = self.tick(q, theta, period=period)
            before, change = change, float(np.abs(out - last).max())
            size = float(np.abs(out).max()) + 1e-3
            rounding = count > 3 and before <= change < ROUNDING * size
            last = out
            if change <= SETTLED * size or rounding:
                return out
        raise Unsettled(f"the ticks do not settle: the command still moves by {change:.2g} Nm")

    def command(self, q: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the settled command after a start in this state."""
        self.reset(q, theta)
        return self.settled(q, theta, period=PERIOD)

    def slope(self, q: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return ∂τ_osc/∂(v, θ) of the settled command, (n, nv + n)."""
        self.reset(q, theta)
        self.settled(q, theta)

        def at(step: np.ndarray) -> np.ndarray:
            there = self._body.move(q, step[: self._body.nv])
            return self.settled(there, theta + step[self._body.nv :])

        return derivative(at, self._body.nv + self._body.n)


class TankLaw(Law):
    """The same with a memory that moves: x̂ follows at a rate, and θ carries it along.

    `settled` lets x̂ arrive; ticks without a period move it with θ alone.
    """

    rate: float = 0.0

    def settled(self, q: np.ndarray, theta: np.ndarray, *, period: float = 10.0) -> np.ndarray:
        """Return the command once x̂ has arrived, with ticks of 10 s."""
        return super().settled(q, theta, period=10.0 if period == PERIOD else period)

    def slope(self, q: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return ∂τ_osc/∂(v, θ) while x̂ moves with θ alone, (n, nv + n)."""

        def at_once(step: np.ndarray) -> np.ndarray:
            return self._after(q, theta, step, period=0.0)

        return derivative(at_once, self._body.nv + self._body.n)

    def slopes(self, q: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Return ∂τ_osc/∂(v, θ) at once and once x̂ has followed, (n, nv + n), and its rate, 1/s."""

        def later(step: np.ndarray) -> np.ndarray:
            return self._after(q, theta, step, period=PERIOD)

        fast = self.slope(q, theta)
        slow = derivative(later, self._body.nv + self._body.n)
        return fast, slow, self._measured_rate(q, theta, fast - slow)

    def _after(self, q, theta, step: np.ndarray, *, period: float) -> np.ndarray:
        """Command (n,) after a settled start and a step."""
        self.reset(q, theta)
        self.settled(q, theta)
        there = self._body.move(q, step[: self._body.nv]), theta + step[self._body.nv :]
        return self.settled(*there, period=period)

    def _measured_rate(self, q: np.ndarray, theta: np.ndarray, gap: np.ndarray) -> float:
        """1/s, from one short tick along the direction in which x̂ has most to follow."""
        if np.abs(gap).max() < 1e-9:
            return 1.0
        step = 1e-4 * np.linalg.svd(gap)[2][0]
        self.reset(q, theta)
        self.settled(q, theta)
        there = self._body.move(q, step[: self._body.nv]), theta + step[self._body.nv :]
        before = self.settled(*there, period=0.0)
        after = self.tick(*there, period=PERIOD)
        self.reset(q, theta)
        self.settled(q, theta)
        end = self.settled(*there)
        left = float((after - end) @ (before - end)) / float((before - end) @ (before - end))
        return -np.log(left) / PERIOD


def derivative(f: Callable[[np.ndarray], np.ndarray], size: int) -> np.ndarray:
    """Return the matrix of partial derivatives at 0 by extrapolated central differences.

    Args:
        f: of a step (size,).
        size: how many columns.

    Raises:
        Unsettled: difference quotients of no step width agree, or f has a corner.
    """
    best, closest, lost = None, np.inf, None
    for width in STEPS:
        try:
            D, gap = _extrapolated(f, size, width)
        except (Unsettled, sealag.SealagError) as error:
            lost = error  # the law exists only nearer to its equilibrium
            continue
        gap = gap / max(float(np.abs(D).max()), 1e-6)
        if gap < closest:
            best, closest = D, gap
        if closest < SMOOTH:
            break
    if best is None and lost is not None:
        raise lost
    if best is None or closest > 1e-5:
        raise Unsettled(f"difference quotients disagree by {closest:.1g} of the derivative")
    _require_linear(f, best, width)
    return best


def _require_linear(f: Callable, D: np.ndarray, width: float) -> None:
    """Refuse a corner: where slopes do not add up, difference quotients are no derivative."""
    way = np.cos(1.0 + 2.0 * np.arange(D.shape[1]))
    slope = (f(width / 4.0 * way) - f(-width / 4.0 * way)) / (width / 2.0)
    off = float(np.abs(slope - D @ way).max(initial=0.0))
    if off > max(CORNERED * float(np.abs(D).max(initial=0.0)), 1e-6):
        raise Unsettled(f"slopes do not add up: {off:.2g} of {np.abs(D).max():.2g} is left over")


def _extrapolated(f: Callable, size: int, width: float) -> tuple[np.ndarray, float]:
    """Richardson's extrapolation over width, width/2, width/4, and how far its last two differ."""
    rows = []
    for h in (width, width / 2.0, width / 4.0):
        columns = [(f(h * e) - f(-h * e)) / (2.0 * h) for e in np.eye(size)]
        rows.append(np.stack(columns, axis=1))
    first = [(4.0 * b - a) / 3.0 for a, b in pairwise(rows)]
    last = (16.0 * first[1] - first[0]) / 15.0
    return last, float(np.abs(last - first[1]).max())
