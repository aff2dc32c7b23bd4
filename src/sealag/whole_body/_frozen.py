"""The frozen closed loop at one configuration: one law and one plant, contacts eliminated."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np

from sealag.actuation import Actuators
from sealag.margin import DelayedLoop, DelayMargin
from sealag.robot import Contact, Robot
from sealag.typing import Array, BoolArray
from sealag.whole_body._evaluation import LawEvaluation
from sealag.whole_body._law import Law
from sealag.whole_body._links import FreeLinks, LinkPlant
from sealag.whole_body._reduced import Memory, without_momentum, without_noise
from sealag.whole_body._rest import Rest
from sealag.whole_body._signal_states import LawDerivative

_DRIFT = 1e-9
"""1/s: a slower decay is none. Ten thousand times less is what rounding leaves of a zero root."""
_MOST_DRIFTING = 8  # zero roots that are counted


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the parts of a state lie."""

    k: int
    n: int
    drives: int
    memory_size: int

    @property
    def size(self) -> int:
        return 2 * (self.k + self.n) + self.drives + self.memory_size

    @property
    def z(self) -> slice:
        return slice(0, self.k)

    @property
    def theta(self) -> slice:
        return slice(self.k, self.k + self.n)

    @property
    def z_rate(self) -> slice:
        return slice(self.k + self.n, 2 * self.k + self.n)

    @property
    def theta_rate(self) -> slice:
        return slice(2 * self.k + self.n, 2 * (self.k + self.n))

    @property
    def torque(self) -> slice:
        return slice(2 * (self.k + self.n), 2 * (self.k + self.n) + self.drives)

    @property
    def memory(self) -> slice:
        return slice(self.size - self.memory_size, self.size)

    def take(self, part: slice, values: Array) -> Array:
        """(p, N) rows that read `values` (p, width) of a part."""
        out = np.zeros((len(values), self.size))
        out[:, part] = values
        return out

    def names(self, joints: tuple[str, ...], drives: Array, *, held: bool) -> tuple[str, ...]:
        angles = [f"z{i}" for i in range(self.k)] + [f"theta:{joint}" for joint in joints]
        rates = [f"d/dt {name}" for name in angles]
        torques = [f"drive:{joints[i]}" for i in drives]
        memory = "memory" if held else "tank"
        return (*angles, *rates, *torques, *(f"{memory}:{i}" for i in range(self.memory_size)))


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenLoop(DelayedLoop):
    """ẋ = A_0 x + B C x(t − d) + A_e x(t − e) about a rest, x = [z, θ, ż, θ̇, τ_m, ξ].

    z are coordinates along the motions that contacts leave free, δq = Z z, without conserved
    momentum that the law feels; τ_m motor torques of drives with a bandwidth; ξ the law's memory.

    Attributes:
        A_0: (N, N) what acts without delay: links, springs, drives, damping.
        B: (N, n) what a command τ_osc does, late by d.
        C: (n, N) the command δτ_osc of a state.
        A_e: (N, N) torque feedback of the drives, late by e; 0 if the design does not delay it.
        embedded_delay: e, s.
        states: names of the states.
        symmetries: (N, s) states along which nothing acts, because gravity, contacts and the law do
            not change: yaw about a point foot, translation of a free robot, unless a task feels it.
        bend: share of the law's derivative that changes within the distance asked for, `beside`.
        memory, memory_period: as in `DelayedLoop`; the tank's x̂ is not counted there.
    """

    # what a loop may leave out, a frozen one always has: by keyword, without a default
    A_0: Array
    B: Array
    C: Array  # pyright: ignore[reportGeneralTypeIssues]
    A_e: Array  # pyright: ignore[reportGeneralTypeIssues]
    embedded_delay: float  # pyright: ignore[reportGeneralTypeIssues]
    states: tuple[str, ...]
    symmetries: Array  # pyright: ignore[reportGeneralTypeIssues]
    bend: float = 0.0

    def margin(self, **choices: Any) -> DelayMargin:
        """Exact margin of a robot's loop; see `DelayedLoop.margin`.

        Where compensation cancels gravity, what is left of a zero root is the rounding of the
        loop's entries: a root without delay that is no further than that from the axis is not
        stable.

        Args:
            choices: as `DelayedLoop.margin` takes them.
        """
        found = DelayedLoop.margin(self, **choices)
        if found.unstable_roots or not len(self.A_0):
            return found
        drifting = int((self.roots(0.0, count=_MOST_DRIFTING).real > -_DRIFT).sum())
        if not drifting:
            return found
        return replace(found, delay=0.0, unstable_roots=drifting, guaranteed=False)

    def _state_names(self) -> tuple[str, ...]:
        return self.states

    def channels(self) -> dict[str, float]:
        """Return the exact margin, s, if one kind of measurement is late and the other is not.

        They are "positions" and "rates": angles and torques, and velocities. What memory that a
        controller moves at its ticks takes in is late with what it measures; the tank's x̂ is late
        with the positions.

        Raises:
            SolverError: a margin is not known.
        """
        rates = np.array([name.startswith("d/dt ") for name in self.states])
        kinds = {"positions": ~rates, "rates": rates}
        return {
            name: float(self.late_measurement(columns).margin().delay)
            for name, columns in kinds.items()
        }

    def jitter_channels(self) -> dict[str, float]:
        """Return the jitter margin, s, of each channel alone, of both ways and of all at once.

        "positions" (angles and torques) and "rates" are measured, the "command" goes down. With
        memory ξ, what the law says of and memory takes in of each, and what it says of memory,

            D_p y_p(t − σ) ,  G_p y_p(t − σ) ,  D_v y_v(t − σ) ,  G_v y_v(t − σ) ,  C_ξ ξ(t − σ)

        are late by a delay of their own: a command that is late by τ shows what was measured at
        t − τ − …, and delays that vary do not commute with memory. "both ways" takes positions and
        rates of one message, "all" of two. The d of both counts the ways up and down together,
        however they share it, and late torque feedback varies up to its own e meanwhile.

        Raises:
            SolverError: rounding leaves a norm open.
        """
        own = np.arange(len(self.states)) >= len(self.states) - self.memory
        rates = np.array([name.startswith("d/dt ") for name in self.states]) & ~own
        split = {"positions": self._measured(~rates & ~own), "rates": self._measured(rates)}
        says = [(self.B, np.where(own, self.C, 0.0))]
        found = {name: self._varying(parts, late=False) for name, parts in split.items()}
        found["command"] = self._varying([(self.B, self.C)], late=False)
        found["both ways"] = self._varying([*self._measured(~own), *says], late=True)
        found["all"] = self._varying([*split["positions"], *split["rates"], *says], late=True)
        # two delays tell more apart than one: what they tolerate, one does
        found["both ways"] = max(found["both ways"], found["all"])
        return found

    def _measured(self, columns: BoolArray) -> list[tuple[Array, Array]]:
        """B and C of what the command says, and of what memory takes in, of some states."""
        plant = len(self.states) - self.memory
        takes = np.where(columns, self.A_0[plant:], 0.0)
        into = np.eye(len(self.states))[:, plant:]
        return [(self.B, np.where(columns, self.C, 0.0)), (into, takes)]

    def _varying(self, parts: list[tuple[Array, Array]], *, late: bool) -> float:
        """Jitter margin of the loop of which these parts, B and C, are late, each by itself; with
        `late` the drives' torque feedback is, too."""
        parts = [(B, C) for B, C in parts if C.any()]
        if not parts:
            return np.inf
        B, C = np.hstack([B for B, _ in parts]), np.vstack([C for _, C in parts])
        loop = DelayedLoop(
            A_0=self.A_0 + self.B @ self.C - B @ C + (0.0 if late else self.A_e),
            B=B,
            C=C,
            A_e=self.A_e if late else None,
            embedded_delay=self.embedded_delay if late else 0.0,
            symmetries=self.symmetries,
        )
        edges = np.cumsum([0, *(len(C) for _, C in parts)]).tolist()
        channels = {f"{k}": range(*ends) for k, ends in enumerate(pairwise(edges))}
        return loop.jitter_margin(channels if len(parts) > 1 else None, alone=False).delay

    def late_measurement(self, columns: BoolArray) -> "FrozenLoop":
        """Return the loop of which only some measured states are late, on their way up.

        Args:
            columns: (N,) which states; those of `memory` are the controller's own and never late.
        """
        plant = len(self.states) - self.memory
        takes = self.A_0[plant:].copy()
        takes[:, plant:] = 0.0
        C = self.C.copy()
        C[:, plant:] = 0.0
        size = float(np.linalg.norm(takes))
        scale = (float(np.linalg.norm(C)) or 1.0) / size if size else 1.0
        B = np.hstack([self.B, np.eye(len(self.states))[:, plant:] / scale])
        C = np.where(columns, np.vstack([C, scale * takes]), 0.0)
        A_0 = self.A_0 + self.B @ self.C - B @ C
        return replace(self, A_0=A_0, B=B, C=C, memory=0, memory_period=0.0)

    @classmethod
    def of(
        cls,
        robot: Robot,
        law: Law,
        actuators: Actuators,
        posture: Array,
        *,
        contacts: tuple[Contact, ...],
        rest: Rest,
        embedded_delay: float | None = None,
        beside: float | None = None,
    ) -> Self:
        """Freeze the closed loop of the law that runs, where it rests.

        Links: Zᵀ M Z z̈ + Zᵀ D_j Z ż + H z = Sᵀ τ_sea with S = U Z,
        τ_sea = K (θ − S z) + D_s (θ̇ − S ż), D_j the joints' own damping, and H as in
        `free_links`. Motors and drives: the rates of the kernel that simulates them. The
        command: the derivative of what the controller ticks.

        Args:
            robot: the robot.
            law: the law.
            actuators: springs, motors and drives.
            posture: (nq,) configuration that the law holds.
            contacts: which frames are held.
            rest: where the loop rests, from `Rest.of`.
            embedded_delay: how late torque feedback is in the drives, s; None for without delay.
            beside: also differentiate the law over this distance, rad, and say in `bend` what
                changes: in a singular posture a law may have no derivative that holds beside it.

        Returns:
            The frozen loop.

        Raises:
            ContractionError: q̄(θ) is fed back and does not exist.
        """
        evaluation = LawEvaluation(
            robot, law, actuators.spring_stiffness, contacts=contacts, posture=posture
        )
        signal = law.signal.start(evaluation, delay_bound=0.0)
        command = signal.derivative(rest.q, rest.theta)
        if law.damped:
            signal.settled(rest.q, rest.theta, np.zeros(robot.n))
            command = command.with_drag(evaluation.drag_slope(), of_links=law.signal.of_links)
        bend = 0.0
        if beside is not None:
            bend = command.change(signal.derivative(rest.q, rest.theta, beside))
        loop = cls.with_derivative(
            robot,
            command,
            actuators,
            contacts=contacts,
            rest=rest,
            embedded_delay=embedded_delay,
        )
        return replace(loop, bend=bend)

    @classmethod
    def with_derivative(
        cls,
        robot: Robot,
        command: LawDerivative,
        actuators: Actuators,
        *,
        contacts: tuple[Contact, ...],
        rest: Rest,
        embedded_delay: float | None = None,
    ) -> Self:
        """Close the loop of links, motors and drives with the derivative of any law.

        Args:
            robot: the robot.
            command: the law's derivative at rest.
            actuators: springs, motors and drives.
            contacts: which frames are held.
            rest: where the loop rests.
            embedded_delay: how late torque feedback is in the drives, s; None for without delay.

        Returns:
            The frozen loop.
        """
        links = cls.free_links(robot, rest.q, rest.tau_sea, contacts=contacts)
        links, kept, C_z, B_z = without_momentum(links, command)
        memory = Memory(
            A=command.A,
            B_z=B_z,
            B_theta=command.B_theta,
            B_z_rate=command.B_v @ links.Z,
            B_rate=command.B_rate,
            C=command.C,
            period=command.period,
            held=command.held,
        )
        S = links.Z[robot.nv_base :]
        H, C_z, C_theta = without_noise(
            links.H, S, actuators.spring_stiffness, C_z=C_z, C_theta=command.C_theta, memory=memory
        )
        loop = cls.of_links(
            actuators,
            M=links.M,
            H=H,
            S=S,
            joint_damping=robot.damping,
            C_z=C_z,
            C_theta=C_theta,
            memory=memory,
            symmetries=kept,
            embedded_delay=embedded_delay,
        )
        C, at = loop.C.copy(), _Places(links.Z.shape[1], robot.n, drives=0, memory_size=0)
        C[:, at.z_rate] += command.C_v @ links.Z
        C[:, at.theta_rate] += command.C_rate
        return replace(loop, C=C)

    @classmethod
    def of_links(
        cls,
        actuators: Actuators,
        *,
        M: Array,
        H: Array,
        S: Array,
        C_z: Array,
        C_theta: Array,
        joint_damping: Array | float = 0.0,
        memory: Memory | None = None,
        symmetries: Array | None = None,
        embedded_delay: float | None = None,
    ) -> Self:
        """Build the loop of links, springs, motors, drives and a late linear command.

        M z̈ + Sᵀ D_j S ż + H z = Sᵀ τ_sea, τ_sea = K (θ − S z) + D_s (θ̇ − S ż), motors and drives
        as in the kernel that simulates them, δτ_osc = C_z z + C_theta θ + C ξ late by d.

        Args:
            actuators: springs, motors and drives of n joints.
            M: (k, k) inertia of the links, kg m².
            H: (k, k) their stiffness, Nm/rad.
            S: (n, k) joint angles of z.
            C_z: (n, k) command of z, Nm/rad.
            C_theta: (n, n) command of θ, Nm/rad.
            joint_damping: (n,) or one number, D_j, Nms/rad.
            memory: what the law remembers; None for nothing.
            symmetries: (k, s) z along which nothing acts.
            embedded_delay: e, how late torque feedback is in the drives, s; None for without delay.
        """
        n, k = S.shape
        drives = np.flatnonzero(np.isfinite(actuators.torque_bandwidth))
        at = _Places(k, n, len(drives), 0 if memory is None else len(memory.A))
        one = np.eye(n)
        angle, rate = at.take(at.theta, one), at.take(at.theta_rate, one)
        link, link_rate = at.take(at.z, S), at.take(at.z_rate, S)
        torque = np.zeros((n, at.size))
        torque[drives, np.arange(at.size)[at.torque]] = 1.0
        spring = actuators.spring_stiffness[:, None] * (angle - link)
        spring += actuators.spring_damping[:, None] * (rate - link_rate)
        drag = np.broadcast_to(joint_damping, n)[:, None] * link_rate
        rows = _motor_rows(actuators, instant=embedded_delay is None)
        moved = np.stack([angle, rate, torque, link, link_rate])
        A_0, B = np.zeros((at.size, at.size)), np.zeros((at.size, n))
        A_0[at.z, at.z_rate], A_0[at.theta, at.theta_rate] = np.eye(k), one
        A_0[at.z_rate] = np.linalg.solve(M, S.T @ (spring - drag) - at.take(at.z, H))
        A_0[at.theta_rate] = np.einsum("pi,pij->ij", rows.speed, moved)
        A_0[at.torque] = np.einsum("pi,pij->ij", rows.torque, moved)[drives]
        B[at.theta_rate] = np.diag(rows.speed_command)
        B[at.torque] = np.diag(rows.torque_command)[drives]
        C = at.take(at.z, C_z) + at.take(at.theta, C_theta)
        if memory is not None:
            C[:, at.memory] = memory.C
            A_0[at.memory, at.memory], A_0[at.memory, at.z] = memory.A, memory.B_z
            A_0[at.memory, at.theta] = memory.B_theta
            A_0[at.memory, at.z_rate] = memory.B_z_rate
            A_0[at.memory, at.theta_rate] = memory.B_rate
        late = embedded_delay is not None
        A_e = B @ (rows.shift[:, None] * spring) if late else np.zeros_like(A_0)
        kept = np.zeros((k, 0)) if symmetries is None else symmetries
        held = memory is not None and memory.held
        return cls(
            A_0=A_0,
            B=B,
            C=C,
            A_e=A_e,
            embedded_delay=embedded_delay or 0.0,
            states=at.names(actuators.joints, drives, held=held),
            symmetries=at.take(at.z, kept.T).T,
            memory=at.memory_size if held else 0,
            memory_period=memory.period if memory is not None and held else 0.0,
        )

    @staticmethod
    def free_links(
        robot: Robot, q: Array, springs: Array, *, contacts: tuple[Contact, ...]
    ) -> FreeLinks:
        """Return inertia and stiffness of the links along what contacts leave free.

        Along rigid motions that change no height, gravity and contacts do not change, so that the
        stiffness is 0 there, also away from an equilibrium.

        Args:
            robot: the robot.
            q: (nq,) configuration at rest.
            springs: (n,) torque of the springs, Nm.
            contacts: which frames are held.
        """
        return LinkPlant(robot, contacts).free(q, springs)


@dataclass(frozen=True, slots=True, kw_only=True)
class _MotorRows:
    """Rates of motor speeds and drive torques (5, n): what angle, speed, drive torque, link angle
    and link speed do; and what a command (n,) and late torque feedback (n,) do."""

    speed: Array
    torque: Array
    speed_command: Array
    torque_command: Array
    shift: Array


def _motor_rows(actuators: Actuators, *, instant: bool) -> _MotorRows:
    """Take the rows from the equation that moves the motors in the simulator."""
    from sealag.kernels.motor import rate_rows

    speed, torque = np.zeros((2, 6, actuators.n))
    rate_rows(tuple(actuators.motors()), instant, speed, torque)
    ratio = actuators.rotor_inertia / actuators.shaped_inertia
    return _MotorRows(
        speed=speed[:5],
        torque=torque[:5],
        speed_command=speed[5],
        torque_command=torque[5],
        shift=(1.0 - ratio) / ratio,
    )
