"""The frozen closed loop at one configuration: one law and one plant, contacts eliminated."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from sealag.actuation import Actuators
from sealag.margin import DelayedLoop, DelayMargin
from sealag.robot import Contact, Robot
from sealag.typing import Array
from sealag.whole_body._evaluation import LawEvaluation
from sealag.whole_body._law import Law
from sealag.whole_body._links import FreeLinks, LinkPlant, norm, null_space
from sealag.whole_body._rest import Rest
from sealag.whole_body._signal_states import LawDerivative

_FELT = 1e-6
"""Share of the law's stiffness from which it counts as feeling a motion of the whole robot. Central
differences leave 1e-9 where it feels none; a task that feels one feels it with its whole gain."""

_KNOWN = 1e-9
"""Share of the law's and the links' stiffness that central differences leave open: a motion that is
held by less is held by nothing."""


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

    def names(self, joints: tuple[str, ...], drives: Array) -> tuple[str, ...]:
        angles = [f"z{i}" for i in range(self.k)] + [f"theta:{joint}" for joint in joints]
        rates = [f"d/dt {name}" for name in angles]
        torques = [f"drive:{joints[i]}" for i in drives]
        return (*angles, *rates, *torques, *(f"tank:{i}" for i in range(self.memory_size)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Memory ξ of a law, in coordinates z of the links: ξ̇ = A ξ + B_z z + B_theta θ + B_rate θ̇, and
    C ξ of the command.

    Attributes:
        A: (s, s) 1/s.
        B_z: (s, k).
        B_theta: (s, n).
        B_rate: (s, n).
        C: (n, s).
    """

    A: Array
    B_z: Array
    B_theta: Array
    B_rate: Array
    C: Array


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
        """Return the exact margin, s, if one channel of the command is late and the other is not.

        The channels are "positions" and "rates": angles and what the law remembers, and what it
        takes from velocities.

        Raises:
            SolverError: a margin is not known.
        """
        rates = np.array([name.startswith("d/dt ") for name in self.states])
        found = {}
        for name, columns in (("positions", ~rates), ("rates", rates)):
            late = np.where(columns, self.C, 0.0)
            alone = replace(self, A_0=self.A_0 + self.B @ (self.C - late), C=late)
            found[name] = float(alone.margin().delay)
        return found

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
        links, kept, C_z, B_z = _without_momentum(links, command)
        memory = Memory(
            A=command.A, B_z=B_z, B_theta=command.B_theta, B_rate=command.B_rate, C=command.C
        )
        S = links.Z[robot.nv_base :]
        H, C_z, C_theta = _without_noise(
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
            A_0[at.memory, at.theta_rate] = memory.B_rate
        late = embedded_delay is not None
        A_e = B @ (rows.shift[:, None] * spring) if late else np.zeros_like(A_0)
        kept = np.zeros((k, 0)) if symmetries is None else symmetries
        return cls(
            A_0=A_0,
            B=B,
            C=C,
            A_e=A_e,
            embedded_delay=embedded_delay or 0.0,
            states=at.names(actuators.joints, drives),
            symmetries=at.take(at.z, kept.T).T,
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


def _without_momentum(
    links: FreeLinks, command: LawDerivative
) -> tuple[FreeLinks, Array, Array, Array]:
    """Split off rigid motions: those that the law does not feel are symmetries; of those that it
    feels the conserved momentum is left out, z are motions without it, rᵀ M z = 0.

    No delay moves the zero roots of what is conserved.

    Returns:
        Links, symmetries (k, s), and the command's and the memory's columns of z.
    """
    rigid, M = links.rigid, links.M
    felt_by = np.vstack([command.C_q, command.B_q]) @ links.Z
    size = max(norm(felt_by), norm(command.C_theta)) * _FELT / 1e-9
    kept = rigid @ null_space(felt_by @ rigid, rigid.shape[1], size=size)
    felt_by = felt_by @ (np.eye(len(M)) - kept @ np.linalg.pinv(kept))
    felt = rigid @ null_space(kept.T @ M @ rigid, rigid.shape[1], size=norm(M))
    Y = null_space(felt.T @ M, len(M), size=norm(M))
    links = replace(links, Z=links.Z @ Y, M=Y.T @ M @ Y, H=Y.T @ links.H @ Y, rigid=Y.T @ rigid)
    felt_by = felt_by @ Y
    n = len(command.C_q)
    return links, Y.T @ kept, felt_by[:n], felt_by[n:]


def _without_noise(
    H: Array, S: Array, K: Array, *, C_z: Array, C_theta: Array, memory: Memory
) -> tuple[Array, Array, Array]:
    """Leave nothing of the stiffness along motions that it holds by no more than differences err.

    A joint whose gravity is compensated and that no task holds rests wherever it is. Its root is 0,
    which rounding of the differences must not push to the left. H z = Sᵀ K (θ − S z) and
    K (θ − S z) = C_z z + C_theta θ then hold exactly along it.

    Returns:
        H, C_z and C_theta.
    """
    k, springs = S.shape[1], np.diag(K)
    settled = np.hstack([C_z, C_theta])
    if len(memory.A):
        settled = settled - memory.C @ np.linalg.solve(
            memory.A, np.hstack([memory.B_z, memory.B_theta])
        )
    stretch = springs @ np.hstack([-S, np.eye(len(K))])
    static = np.vstack([np.hstack([H, np.zeros_like(S.T)]) - S.T @ stretch, stretch - settled])
    _, values, rows = np.linalg.svd(static)
    loose = rows[values <= _KNOWN * (norm(H) + norm(settled))].T
    left = static @ loose
    command = left[k:] @ loose.T
    z = np.linalg.pinv(loose[:k])
    links = left[:k] @ z
    links = links + links.T - z.T @ (loose[:k].T @ links)
    return H - links, C_z + command[:, :k], C_theta + command[:, k:]


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
