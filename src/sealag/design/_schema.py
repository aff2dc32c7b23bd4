"""What a project file may say: one class a section, every key with its unit in its name or here."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Milliseconds = Annotated[FiniteFloat, Field(ge=0, le=5000)]


class Section(BaseModel):
    """A table of the project file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RobotSection(Section):
    """[robot]"""

    urdf: str
    base: Literal["floating", "fixed"]
    actuated: list[str] | None = None


class PostureSection(Section):
    """[posture]: the configuration that is certified without a motion, rad and m."""

    base_position: Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    base_quaternion_xyzw: Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)] = [
        0.0,
        0.0,
        0.0,
        1.0,
    ]
    joints: dict[str, FiniteFloat] = {}


class ActuatorKeys(Section):
    """Keys of [actuators.default] and [actuators.joint.<name>], SI units."""

    spring_stiffness: Positive | None = None
    rotor_inertia: Positive | None = None
    inertia_shaping: Positive | None = None
    motor_damping: Positive | None = None
    spring_damping: NotNegative | None = None
    coulomb_friction: NotNegative | None = None
    viscous_friction: NotNegative | None = None
    torque_limit: Positive | None = None
    velocity_limit: Positive | None = None
    torque_bandwidth: Positive | None = None


class ActuatorsSection(Section):
    """[actuators]: what holds for all joints, and what differs at some."""

    default: ActuatorKeys = ActuatorKeys()
    joint: dict[str, ActuatorKeys] = {}


class ContactSection(Section):
    """[[contacts]]"""

    frame: str
    kind: Literal["point", "surface"] = "point"


class ControllerSection(Section):
    """[controller]"""

    feedback: Literal["motor", "static_joint", "static_joint_tank", "joint"]
    gravity: Literal["feedback", "planned", "none"]
    stiffness_form: Literal["symmetric", "published", "force"] = "symmetric"
    task_inertia: Literal["lambda_ts", "lambda_star"] = "lambda_ts"
    task_error: Literal["consistent", "plain"] = "consistent"
    criterion: Literal["certified", "published"] = "certified"
    tank_flow: Literal["corrected", "published"] = "corrected"
    tank_energy_j: NotNegative = 1.0
    tank_rate: NotNegative = 5.0


class TaskSection(Section):
    """[[tasks]]"""

    name: str
    kind: Literal["com", "position", "orientation", "pose", "posture"]
    stiffness: NotNegative | list[NotNegative]
    frame: str | None = None
    joints: list[str] = []
    axes: list[Literal["x", "y", "z", "rx", "ry", "rz"]] = []
    priority: Annotated[int, Field(ge=1)] = 1


class DelayTable(Section):
    """What any delay's table may say about packets; of a round trip it holds for each way"""

    jitter_ms: Milliseconds = 0.0
    packet_loss: Annotated[FiniteFloat, Field(ge=0, lt=1)] = 0.0
    max_burst: Annotated[int, Field(ge=1)] = 10
    order: Literal["fifo", "newest", "arrival"] = "fifo"


class ConstantDelay(DelayTable):
    """kind = "constant" """

    kind: Literal["constant"]
    value_ms: Milliseconds


class SinusoidDelay(DelayTable):
    """kind = "sinusoid": mean + amplitude sin(ω t + phase)"""

    kind: Literal["sinusoid"]
    mean_ms: Milliseconds
    amplitude_ms: Milliseconds
    angular_frequency_rad_s: FiniteFloat = 1.0
    phase_rad: FiniteFloat = 0.0


class TableDelay(DelayTable):
    """kind = "table": linear between instants"""

    kind: Literal["table"]
    time_s: list[FiniteFloat]
    delay_ms: list[Milliseconds]


class SamplesDelay(DelayTable):
    """kind = "samples": measured round trips, one a line, in ms"""

    kind: Literal["samples"]
    file: str
    period_s: Positive
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
    sample_time_ms: Milliseconds = 0.0
    embedded_period_ms: Milliseconds = 0.0
    delayed_torque_feedback: bool = False


class MotionSection(Section):
    """[motion]"""

    file: str


class PushSection(Section):
    """[[simulation.pushes]]: a constant force on a frame, world axes"""

    frame: str
    force_n: Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
    start_s: NotNegative
    duration_s: Positive


class PaperTerrain(Section):
    """kind = "paper": up 9 cm, down 12 cm, up 9 cm"""

    kind: Literal["paper"]


class FlatTerrainKeys(Section):
    """kind = "flat" """

    kind: Literal["flat"]


class RoughTerrain(Section):
    """kind = "rough": random heights in ± amplitude"""

    kind: Literal["rough"]
    seed: Annotated[int, Field(ge=0)] = 0
    amplitude_m: Positive = 0.05


class StairsTerrain(Section):
    """kind = "stairs": level treads"""

    kind: Literal["stairs"]
    rises_m: Annotated[list[FiniteFloat], Field(min_length=1)]
    run_m: Positive = 0.45


TerrainKeys = Annotated[
    PaperTerrain | FlatTerrainKeys | RoughTerrain | StairsTerrain, Field(discriminator="kind")
]


class WalkingSection(Section):
    """[walking]: the gait, the ground and the walking controller's means, by the names of
    `WalkingGait` and `WalkingOptions`"""

    feet: Annotated[list[str], Field(min_length=2, max_length=2)]
    steps: Annotated[int, Field(ge=1, le=1000)] = 7
    friction: Positive = 0.8
    terrain: TerrainKeys = PaperTerrain(kind="paper")
    gait: dict[str, FiniteFloat] = {}
    options: dict[str, bool | FiniteFloat | str] = {}


class SimulationSection(Section):
    """[simulation]: how `sealag simulate` runs the design"""

    scenario: Literal["regulate", "track", "drop", "balance", "walk"] = "regulate"
    duration_s: Positive = 2.0
    physics_step_ms: Annotated[FiniteFloat, Field(gt=0, le=10)] | None = None
    friction: Positive = 0.8
    foot_radius: NotNegative = 0.0
    foot_half_length: Positive = 0.1
    foot_half_width: Positive = 0.06
    torsional_damping: NotNegative = 0.0
    torsional_radius: Positive | None = None
    drop_height: NotNegative = 0.03
    track_amplitude: NotNegative = 0.02
    track_frequency_hz: Positive = 0.5
    seed: Annotated[int, Field(ge=0)] = 0
    pushes: list[PushSection] = []


class Project(Section):
    """A whole project file."""

    robot: RobotSection
    posture: PostureSection = PostureSection()
    actuators: ActuatorsSection
    contacts: list[ContactSection] = []
    controller: ControllerSection
    tasks: Annotated[list[TaskSection], Field(min_length=1)]
    delays: DelaysSection
    motion: MotionSection | None = None
    simulation: SimulationSection = SimulationSection()
    walking: WalkingSection | None = None
