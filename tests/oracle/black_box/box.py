"""What the black box says about a design."""

from dataclasses import dataclass, replace

import numpy as np

import sealag
from oracle.black_box.body import Body
from oracle.black_box.design import Drive, read_design
from oracle.black_box.law import Law, TankLaw, Unsettled
from oracle.black_box.loop import Linear, Loop
from oracle.black_box.rest import NoEquilibrium, Search, State
from oracle.black_box.roots import first_crossing, roots, unstable_count

KNIFE_EDGE = 1e-7
"""|Re s| / (1 + |s|) below which rounding may decide on which side of the axis a root is."""
ON_AXIS = 1e-11
"""|Re s| / (1 + |s|) below which a root is on the axis: nothing there is asymptotically stable."""
SAME_STATE = 1e-9
"""rad, m: two states no further apart are one."""
ROWS = {"point": 3, "surface": 6}


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the black box says about a loop at a state.

    Attributes:
        state: where it is linearised.
        overloaded: joints whose spring torque there exceeds the drive's limit.
        unstable: roots not left of the axis without delay, symmetries left out.
        nearest: |Re s| / (1 + |s|) of the root nearest to the axis: a knife's edge if tiny.
        rightmost: largest real part without delay, 1/s.
        margin: constant delay margin, s; 0 if unstable without delay, inf if there is none.
        frequency: of the first crossing, rad/s.
        loop: the matrices.
    """

    state: State
    overloaded: tuple[str, ...]
    unstable: int
    nearest: float
    rightmost: float
    margin: float
    frequency: float
    loop: Loop

    @property
    def stable(self) -> bool:
        """Whether every root is left of the axis without delay."""
        return self.unstable == 0

    @property
    def decided(self) -> bool:
        """Whether no root is so near to the axis that rounding decides."""
        return self.nearest > KNIFE_EDGE or self.on_axis

    @property
    def on_axis(self) -> bool:
        """Whether a root lies on the axis to rounding."""
        return self.nearest < ON_AXIS


class BlackBox:
    """One design at one posture with one set of contacts."""

    def __init__(self, path, system, *, q=None, contacts=None, **broken: bool) -> None:
        """Read the design again, and take its controller.

        Args:
            path: the project file.
            system: as `sealag.load` returns it, for its controller only.
            q: (nq,) posture; the project's if None.
            contacts: held frames as sealag names them; the project's if None.
            broken: negative controls: `no_contact_forces`, `no_spring_damping`,
                `no_link_damping`, `no_base_feedback`.
        """
        design = read_design(path)
        if contacts is not None:
            held = tuple((c.frame, ROWS[c.kind.value]) for c in contacts)
            design = replace(design, contacts=held)
        self.design, self.body = design, Body(design)
        assert tuple(self.body.joints) == tuple(system.robot.joints)
        self.drive = Drive.of(design, self.body.joints, self.body.efforts)
        self.posture = self.body.posture(design) if q is None else np.array(q, dtype=float)
        tank = design.feedback == "static_joint_tank"
        kind = TankLaw if tank else Law
        self.law = kind(self.body, system, self.posture, self.drive.K, contacts)
        self._search = Search(self.body, self.drive, self.law, self.posture)
        self._linear = Linear(
            self.body,
            self.drive,
            self.law,
            remembers=tank and design.tank_pays,
            late=design.torque_feedback_delay,
            broken=broken,
        )

    def rest(self, start: tuple[np.ndarray, np.ndarray] | None = None) -> State:
        """Return where the loop rests.

        Args:
            start: q and θ from which to look; near the posture if None.

        Raises:
            NoEquilibrium: it rests nowhere.
            Unsettled, SealagError: the law does not exist there.
        """
        return self._search.rest(start)

    def in_posture(self) -> State:
        """Return the loop in its posture, without task error.

        Raises:
            NoEquilibrium: contacts do not balance it.
        """
        return self._search.in_posture(self.design.feedback, self.design.gravity)

    def loop(self, state: State) -> Loop:
        """Return the loop linearised at a state.

        Args:
            state: from `rest` or `in_posture`.
        """
        return self._linear.loop(state)

    def answer(self, state: State | None = None) -> Answer:
        """Return what there is to say about the loop at a state.

        Args:
            state: where; where it rests if None.

        Raises:
            NoEquilibrium: it rests nowhere.
            Unsettled: the law has no derivative there.
        """
        state = self.rest() if state is None else state
        loop = self.loop(state)
        here = roots(loop.A_0, [*loop.fixed, loop.delayed])
        unstable, nearest = unstable_count(here)
        margin, frequency = 0.0, float("nan")
        if not unstable:
            margin, frequency = first_crossing(loop.A_0, loop.fixed, loop.delayed)
        over = np.flatnonzero(np.abs(state.torque) > self.drive.limit * (1.0 + 1e-9))
        return Answer(
            state=state,
            overloaded=tuple(self.body.joints[i] for i in over),
            unstable=unstable,
            nearest=nearest,
            rightmost=float(here.real.max()) if len(here) else -np.inf,
            margin=margin,
            frequency=frequency,
            loop=loop,
        )

    def both(self) -> "Both":
        """Return the answers in the posture and where the loop rests, or why there is none."""
        found: list[Answer | Exception] = []
        try:
            found.append(self.answer(self.in_posture()))
        except (NoEquilibrium, Unsettled, sealag.SealagError) as error:
            found.append(error)
        try:
            rest = self.rest()
            there = found[0]
            found.append(there if _same(there, rest) else self.answer(rest))
        except (NoEquilibrium, Unsettled, sealag.SealagError) as error:
            found.append(error)
        return Both(posture=found[0], rest=found[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Both:
    """The two loops of a design, of which the worse counts.

    Attributes:
        posture: in the posture, or why there is none.
        rest: where it rests, or why there is none.
    """

    posture: Answer | Exception
    rest: Answer | Exception

    @property
    def answers(self) -> list[Answer]:
        """Those that there are, each once."""
        found = [one for one in (self.posture, self.rest) if isinstance(one, Answer)]
        return found[:1] if len(found) == 2 and found[0] is found[1] else found

    @property
    def missing(self) -> list[Exception]:
        """Why the others are missing."""
        return [one for one in (self.posture, self.rest) if isinstance(one, Exception)]

    @property
    def margin(self) -> float:
        """The smaller margin, s; 0 where a loop is missing."""
        return 0.0 if self.missing else min(one.margin for one in self.answers)

    @property
    def unstable(self) -> int:
        """Unstable roots of the worse loop."""
        return max((one.unstable for one in self.answers), default=0)

    @property
    def stable(self) -> bool:
        """Whether both loops are there, and every root is left of the axis without delay."""
        return not self.missing and self.unstable == 0


def _same(there: Answer | Exception, rest: State) -> bool:
    if not isinstance(there, Answer):
        return False
    apart = [rest.q - there.state.q, rest.theta - there.state.theta]
    return max(float(np.abs(one).max(initial=0.0)) for one in apart) < SAME_STATE


def answer(path, system, **options) -> Both:
    """Return the black box's answers for a project file at its posture.

    Args:
        path: the project file.
        system: as `sealag.load` returns it.
        options: as for `BlackBox`.
    """
    return BlackBox(path, system, **options).both()
