"""What a project file may say: one class a section, every key with its unit in its name or here.

Ranges are generous, but physical: what lies outside is a slip of the pen or a mistaken unit, and
would overflow or leave the numerics without an answer.
"""

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    FiniteFloat,
    Tag,
)
from pydantic_core import PydanticCustomError

from sealag.delay import PacketOrder
from sealag.passivity import Criterion
from sealag.robot import ContactKind
from sealag.whole_body import (
    GravityCompensation,
    LinkAngles,
    MotorAngles,
    Signal,
    StiffnessForm,
    TankFlow,
    TaskError,
    TaskInertia,
    TaskKind,
)

AXES = ("x", "y", "z", "rx", "ry", "rz")
"""The rows of a pose: position, then rotation."""

SCENARIOS = ("regulate", "track", "drop", "balance", "walk")
"""What `sealag simulate` can run."""


def _within(low: float, high: float, unit: str = "", *, or_zero: bool = False) -> AfterValidator:
    """Refuse numbers outside a range with the range and its unit."""
    need = f"it must {'be 0 or ' if or_zero else ''}lie in {low:g} … {high:g} {unit}".rstrip()

    def check(value: float) -> float:
        if low <= value <= high or (or_zero and value == 0.0):
            return value
        raise PydanticCustomError("range", "{need}", {"need": need})

    return AfterValidator(check)


Milliseconds = Annotated[FiniteFloat, _within(0, 5000, "ms")]
Period = Annotated[FiniteFloat, _within(1e-3, 5000, "ms", or_zero=True)]
Length = Annotated[FiniteFloat, _within(1e-6, 1e3, "m")]
LengthOrZero = Annotated[FiniteFloat, _within(0, 1e3, "m")]
Coordinate = Annotated[FiniteFloat, _within(-1e4, 1e4, "m")]
Friction = Annotated[FiniteFloat, _within(1e-6, 1e3)]
Inertia = Annotated[FiniteFloat, _within(1e-9, 1e4, "kg m²")]
SpringStiffness = Annotated[FiniteFloat, _within(1e-3, 1e8, "Nm/rad")]
Ratio = Annotated[FiniteFloat, _within(1e-4, 1e4)]
MotorDamping = Annotated[FiniteFloat, _within(1e-6, 1e6, "Nms/rad")]
Damping = Annotated[FiniteFloat, _within(0, 1e6, "Nms/rad")]
TorqueOrZero = Annotated[FiniteFloat, _within(0, 1e6, "Nm")]
Torque = Annotated[FiniteFloat, _within(1e-6, 1e7, "Nm")]
Rate = Annotated[FiniteFloat, _within(1e-6, 1e7, "rad/s")]
Gain = Annotated[
    FiniteFloat,
    _within(1e-6, 1e9, "1/s², or N/m or Nm/rad if stiffness_form is force", or_zero=True),
]
JointStiffness = Annotated[FiniteFloat, _within(0, 1e8, "Nm/rad")]
TaskDamping = Annotated[FiniteFloat, _within(0, 1e6, "N s/m or Nm s/rad")]
Duration = Annotated[FiniteFloat, _within(1e-6, 1e6, "s")]
Instant = Annotated[FiniteFloat, _within(-1e12, 1e12, "s")]
Entry = Annotated[FiniteFloat, _within(-1e12, 1e12)]
Seed = Annotated[int, Field(ge=0)]


def _one_of(words: Iterable[str]) -> AfterValidator:
    """Refuse words that are not among those that the code itself knows."""
    known = [str(word) for word in words]
    need = "it must be " + " or ".join([", ".join(map(repr, known[:-1])), repr(known[-1])])

    def check(value: str) -> str:
        if value in known:
            return value
        raise PydanticCustomError("range", "{need}", {"need": need})

    return AfterValidator(check)


def _filled(value: str) -> str:
    """Refuse what a starter leaves to be filled in."""
    if value.startswith("FILL"):
        raise PydanticCustomError("range", "it must be the name of a frame")
    return value


def _by_shape(value: Any) -> str:
    return "list" if isinstance(value, list) else "number"


class Section(BaseModel):
    """A table of the project file; unknown keys are refused, and so is text for a number."""

    # A section is checked with its file: validators of its own would cost time at each start.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)


class RobotSection(Section):
    """[robot]"""

    urdf: str
    base: Literal["floating", "fixed"]
    actuated: list[str] | None = None


class PostureSection(Section):
    """[posture]: the configuration that is certified without a motion, rad and m."""

    base_position: Annotated[list[Coordinate], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    base_quaternion_xyzw: Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)] = [
        0.0,
        0.0,
        0.0,
        1.0,
    ]
    joints: dict[str, FiniteFloat] = {}


class ActuatorKeys(Section):
    """Keys of [actuators.default] and [actuators.joint.<name>], SI units."""

    spring_stiffness: SpringStiffness | None = None
    rotor_inertia: Inertia | None = None
    inertia_shaping: Ratio | None = None
    motor_damping: MotorDamping | None = None
    spring_damping: Damping | None = None
    coulomb_friction: TorqueOrZero | None = None
    viscous_friction: Damping | None = None
    torque_limit: Torque | None = None
    velocity_limit: Rate | None = None
    torque_bandwidth: Rate | None = None


class ActuatorsSection(Section):
    """[actuators]: what holds for all joints, and what differs at some."""

    default: ActuatorKeys = ActuatorKeys()
    joint: dict[str, ActuatorKeys] = {}


class ContactSection(Section):
    """[[contacts]]"""

    frame: Annotated[str, AfterValidator(_filled)]
    kind: Annotated[str, _one_of(ContactKind)] = ContactKind.POINT.value


class WholeBodyKeys(Section):
    """[controller] of kind "wbosc": the paper's whole-body law of [[tasks]]"""

    kind: Literal["wbosc"] = "wbosc"
    feedback: Annotated[str, _one_of(Signal.names())]
    gravity: Annotated[str, _one_of(GravityCompensation)]
    stiffness_form: Annotated[str, _one_of(StiffnessForm)] = StiffnessForm.SYMMETRIC.value
    task_inertia: Annotated[str, _one_of(TaskInertia)] = TaskInertia.LAMBDA_TS.value
    task_error: Annotated[str, _one_of(TaskError)] = TaskError.CONSISTENT.value
    criterion: Annotated[str, _one_of(Criterion)] = Criterion.CERTIFIED.value
    tank_flow: Annotated[str, _one_of(TankFlow)] = TankFlow.CORRECTED.value
    tank_energy_j: Annotated[FiniteFloat, _within(0, 1e9, "J")] = 1.0
    tank_rate: Annotated[FiniteFloat, _within(0, 1e6, "1/s")] = 5.0


class JointPdKeys(Section):
    """[controller] of kind "joint_pd": τ = K_p (q_d − q) − K_d q̇ + ḡ, joint by joint"""

    kind: Literal["joint_pd"]
    feedback: Annotated[str, _one_of((MotorAngles.name, LinkAngles.name))] = MotorAngles.name
    gravity: Annotated[str, _one_of(GravityCompensation)]
    kp: JointStiffness | dict[str, JointStiffness]
    kd: Damping | dict[str, Damping] = 0.0
    damping_at: Literal["controller", "drive"] = "controller"


class ProgramKeys(Section):
    """[controller] of kind "python": a function of the user's own makes what ticks"""

    kind: Literal["python"]
    file: str
    function: str = "controller"


class MatrixKeys(Section):
    """[controller] of kind "matrices": ẋ_c = A x_c + B y, δτ = C x_c + D y about the posture"""

    kind: Literal["matrices"]
    feedback: Annotated[str, _one_of((MotorAngles.name, LinkAngles.name))] = MotorAngles.name
    time: Literal["continuous", "discrete"] = "continuous"
    file: str | None = None
    A: list[list[Entry]] | None = None
    B: list[list[Entry]] | None = None
    C: list[list[Entry]] | None = None
    D: list[list[Entry]] | None = None
    inputs: list[str] = []
    outputs: list[str] = []


def _kind_of(value: Any) -> str:
    """The kind of a [controller] table: the paper's law if none is named."""
    return str(value.get("kind", "wbosc")) if isinstance(value, dict) else "wbosc"


ControllerKeys = Annotated[
    Annotated[WholeBodyKeys, Tag("wbosc")]
    | Annotated[JointPdKeys, Tag("joint_pd")]
    | Annotated[MatrixKeys, Tag("matrices")]
    | Annotated[ProgramKeys, Tag("python")],
    Discriminator(_kind_of),
]


class TaskSection(Section):
    """[[tasks]]"""

    name: str
    kind: Annotated[str, _one_of(TaskKind)]
    stiffness: Annotated[
        Annotated[Gain, Tag("number")] | Annotated[list[Gain], Tag("list")],
        Discriminator(_by_shape),
    ]
    frame: str | None = None
    joints: list[str] = []
    axes: list[Annotated[str, _one_of(AXES)]] = []
    priority: Annotated[int, Field(ge=1)] = 1
    damping: Annotated[
        Annotated[TaskDamping, Tag("number")] | Annotated[list[TaskDamping], Tag("list")],
        Discriminator(_by_shape),
    ] = 0.0


class DelayTable(Section):
    """What any delay's table may say about packets; of a round trip it holds for each way"""

    jitter_ms: Milliseconds = 0.0
    packet_loss: Annotated[FiniteFloat, Field(ge=0, lt=1)] = 0.0
    max_burst: Annotated[int, Field(ge=1)] = 10
    order: Annotated[str, _one_of(PacketOrder)] = PacketOrder.FIFO.value


class ConstantDelay(DelayTable):
    """kind = "constant" """

    kind: Literal["constant"]
    value_ms: Milliseconds


class SinusoidDelay(DelayTable):
    """kind = "sinusoid": mean + amplitude sin(ω t + phase)"""

    kind: Literal["sinusoid"]
    mean_ms: Milliseconds
    amplitude_ms: Milliseconds
    angular_frequency_rad_s: Annotated[FiniteFloat, _within(-1e6, 1e6, "rad/s")] = 1.0
    phase_rad: Annotated[FiniteFloat, _within(-1e3, 1e3, "rad")] = 0.0


class TableDelay(DelayTable):
    """kind = "table": linear between instants"""

    kind: Literal["table"]
    time_s: list[Instant]
    delay_ms: list[Milliseconds]


class SamplesDelay(DelayTable):
    """kind = "samples": measured round trips, one a line, in ms"""

    kind: Literal["samples"]
    file: str
    period_s: Duration
    quantile: Annotated[FiniteFloat, Field(gt=0, le=1)] = 1.0


DelayKeys = Annotated[
    ConstantDelay | SinusoidDelay | TableDelay | SamplesDelay, Field(discriminator="kind")
]


class DelaysSection(Section):
    """[delays]: each connection as a round trip, or both of its ways"""

    central_round_trip: DelayKeys | None = None
    central_up: DelayKeys | None = None
    central_down: DelayKeys | None = None
    embedded_round_trip: DelayKeys | None = None
    embedded_up: DelayKeys | None = None
    embedded_down: DelayKeys | None = None
    sample_time_ms: Period = 0.0
    embedded_period_ms: Period = 0.0
    delayed_torque_feedback: bool = False


class MotionSection(Section):
    """[motion]"""

    file: str


class PushSection(Section):
    """[[simulation.pushes]]: a constant force on a frame, world axes"""

    frame: str
    force_n: Annotated[
        list[Annotated[FiniteFloat, _within(-1e6, 1e6, "N")]], Field(min_length=3, max_length=3)
    ]
    start_s: Annotated[FiniteFloat, _within(0, 1e6, "s")]
    duration_s: Duration


class PaperTerrain(Section):
    """kind = "paper": up 9 cm, down 12 cm, up 9 cm"""

    kind: Literal["paper"]


class FlatTerrainKeys(Section):
    """kind = "flat" """

    kind: Literal["flat"]


class RoughTerrain(Section):
    """kind = "rough": random heights in ± amplitude"""

    kind: Literal["rough"]
    seed: Seed = 0
    amplitude_m: Length = 0.05


class StairsTerrain(Section):
    """kind = "stairs": level treads"""

    kind: Literal["stairs"]
    rises_m: Annotated[list[Coordinate], Field(min_length=1)]
    run_m: Length = 0.45


TerrainKeys = Annotated[
    PaperTerrain | FlatTerrainKeys | RoughTerrain | StairsTerrain, Field(discriminator="kind")
]


class WalkingSection(Section):
    """[walking]: the gait, the ground and the walking controller's means, by the names of
    `WalkingGait` and `WalkingOptions`"""

    feet: Annotated[list[str], Field(min_length=2, max_length=2)]
    steps: Annotated[int, Field(ge=1, le=1000)] = 7
    friction: Friction = 0.8
    terrain: TerrainKeys = PaperTerrain(kind="paper")
    gait: dict[str, FiniteFloat] = {}
    options: dict[str, FiniteFloat | bool | str] = {}


class SimulationSection(Section):
    """[simulation]: how `sealag simulate` runs the design"""

    scenario: Annotated[str, _one_of(SCENARIOS)] = SCENARIOS[0]
    duration_s: Duration = 2.0
    physics_step_ms: Annotated[FiniteFloat, _within(1e-3, 10, "ms")] | None = None
    log_period_ms: Annotated[FiniteFloat, _within(1e-3, 1e6, "ms")] | None = None
    model_period_ms: Annotated[FiniteFloat, _within(0, 1e6, "ms")] = 0.0
    friction: Friction = 0.8
    foot_radius: LengthOrZero = 0.0
    foot_half_length: Length = 0.1
    foot_half_width: Length = 0.06
    torsional_damping: Damping = 0.0
    torsional_radius: Length | None = None
    drop_height: LengthOrZero = 0.03
    track_amplitude: LengthOrZero = 0.02
    track_frequency_hz: Annotated[FiniteFloat, _within(1e-6, 1e3, "Hz")] = 0.5
    seed: Seed = 0
    pushes: list[PushSection] = []


class Project(Section):
    """A whole project file."""

    robot: RobotSection
    posture: PostureSection = PostureSection()
    actuators: ActuatorsSection
    contacts: list[ContactSection] = []
    controller: ControllerKeys
    tasks: list[TaskSection] = []
    delays: DelaysSection
    motion: MotionSection | None = None
    simulation: SimulationSection = SimulationSection()
    walking: WalkingSection | None = None
