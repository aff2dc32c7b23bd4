"""What a certificate asks and answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from sealag.passivity._kinds import Criterion, Status
from sealag.passivity._layout import Time, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumption:
    """Something that is assumed and not checked.

    Attributes:
        key: a short name that stays the same from one certificate to the next.
        text: the assumption, in a sentence.
    """

    key: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """Where the loop of a single posture rests.

    Attributes:
        found: whether an equilibrium was found near the posture.
        moved_rad: largest joint distance between the posture and where the loop rests, rad.
    """

    found: bool
    moved_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Critical:
    """The instant that sets the local margin: the smallest, among zeros the most unstable.

    Attributes:
        instant: its index.
        time_s: its time, s.
    """

    instant: int
    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Worst:
    """The instant with the smallest bound.

    Attributes:
        instant: its index.
        time_s: its time, s.
        direction: share of each joint in the motion that first turns the delayed loop active.
    """

    instant: int
    time_s: float
    direction: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What was asked, and of which design.

    Attributes:
        criterion: published or certified.
        delay_s: upper bound of the design's own delay d_1, s.
        joints: names, in the order of all arrays.
        instants: number of instants.
        levels: (k + 1,) first task row of each priority level, then m.
        feedback: the signal that is fed back.
        gravity: how gravity is compensated.
        stiffness_form: how stiffness follows from K_x and Λ.
        task_inertia: which Λ that is.
        D_theta: (n,) motor damping, Nms/rad.
        spring_stiffness: (n,) K, Nm/rad.
        spring_damping: (n,) D_s beside the springs, Nms/rad.
        viscous_friction: (n,) at the motors, Nms/rad.
        motor_inertia: (n,) B_s, kg m².
        rotor_inertia: (n,) B, kg m².
        torque_bandwidth: (n,) of the drives, rad/s; None for an ideal one.
        hashes: SHA-256 of the URDF and the project file; in a file also of its own content.
    """

    criterion: Criterion
    delay_s: float
    joints: Annotated[tuple[str, ...], "n"]
    instants: Annotated[int, "N"]
    levels: tuple[int, ...]
    feedback: str
    gravity: str
    stiffness_form: str
    task_inertia: str
    D_theta: Vector
    spring_stiffness: Vector
    spring_damping: Vector
    viscous_friction: Vector
    motor_inertia: Vector
    rotor_inertia: Vector
    torque_bandwidth: Annotated[tuple[float | None, ...], "n"]
    hashes: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What is claimed.

    A time is inf, and "unbounded" in the file, where no delay is too long; None, and null in the
    file, means not known, or not asked for where it says so.

    Attributes:
        status: certified, passive only, or not certified.
        reasons: why it is not certified; of what is passive only, why it is not known to be stable.
        max_delay_s: smallest bound over the motion, s; 0 where a condition of the criterion fails.
        max_delay_upper_s: no longer delay satisfies the criterion at the worst instant, s.
        worst: the instant that sets the bound.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖ over the motion, F the criterion's stiffness.
        contraction: largest contraction factor of q̄(θ) over the motion.
        published_max_delay_s: what (29) or (31) as printed gives for the same design, s; None where
            a level of several has gains that differ, so that only a semidefinite program tells it,
            and the criterion is certified.
        common_multiplier_delay_s: bound with one multiplier for the whole motion, which V_4 needs;
            None if it was not asked for.
        time_varying_delay_s: bound for matrices that vary as they like inside polytopes around
            the motion, window by window, s; None if it was not asked for.
        left_open: why a solver proved no longer delay, by the name of the bound: `max_delay_s`,
            `common_multiplier_delay_s`, `time_varying_delay_s`. Such a bound below the design's
            delay decides nothing, and the design is not certified.
        stable: whether the loop is stable without delay at all instants; None where that is not
            decided at one of them, and unstable at none.
        unstable_modes: roots with positive real part without delay, the most over all instants.
        jitter_margin_s: of the frozen loop at the critical instant, s: it is stable for every delay
            that varies as it likes below this one; 0 where its margin is 0.
        local_margin_s: smallest exact local delay margin over all instants, s; 0 where a mode is
            unstable without delay.
        critical: the instant that sets the local margin.
        first_crossing_s: delay at which one more pair of roots crosses at the critical instant, s;
            the local margin where no root is unstable without delay.
        equilibrium: where the loop rests; None for a motion.
        conservatism: local margin over max_delay_s; None where either is 0 or unbounded too.
        holds_for: against what max_delay_s, jitter_margin_s and local_margin_s are robust.
        assumptions: what is assumed and not checked.
        versions: of sealag and the libraries that computed it; the kernels of `blas` decide the
            last bits of its numbers.
    """

    status: Status
    reasons: tuple[str, ...]
    max_delay_s: Time
    max_delay_upper_s: Time
    worst: Worst
    asymmetry: float | None
    contraction: float | None
    published_max_delay_s: Time | None
    common_multiplier_delay_s: Time | None
    time_varying_delay_s: Time | None
    left_open: Mapping[str, str]
    stable: bool | None
    unstable_modes: int
    jitter_margin_s: Time | None
    local_margin_s: Time | None
    critical: Critical
    first_crossing_s: Time | None
    equilibrium: Rest | None
    conservatism: float | None
    holds_for: Mapping[str, str]
    assumptions: tuple[Assumption, ...]
    versions: Mapping[str, str]
