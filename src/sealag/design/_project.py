"""The project file: read, checked key by key, and turned into a System."""

import hashlib
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from sealag.actuation import Actuators, actuators
from sealag.delay import (
    Constant,
    Delays,
    DelaySignal,
    Link,
    PacketOrder,
    RoundTrip,
    Sinusoid,
    Table,
    measured,
)
from sealag.design._schema import Project
from sealag.design._system import System, Tank
from sealag.design._walking import walking_of
from sealag.errors import FileError, ProjectError, SealagError, UnknownNameError
from sealag.passivity import Criterion
from sealag.robot import Contact, ContactKind, Robot, load_robot, resolve_urdf
from sealag.whole_body import (
    Feedback,
    GravityCompensation,
    Hierarchy,
    StiffnessForm,
    TankFlow,
    Task,
    TaskError,
    TaskInertia,
    TaskKind,
)

LARGEST_PROJECT_BYTES = 1_000_000
_AXES = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
_REQUIRED = ("spring_stiffness", "rotor_inertia", "motor_damping", "inertia_shaping")


def resolve_project(text: str | Path) -> Path:
    """Return the path of a project file, which may be a bundled one.

    Args:
        text: a path, or `bundled:hume`.

    Raises:
        UnknownNameError: no bundled project has this name.
    """
    if not str(text).startswith("bundled:"):
        return Path(text)
    from importlib import resources

    folder = Path(str(resources.files("sealag.data")))
    name = str(text).removeprefix("bundled:").removesuffix(".toml")
    path = folder / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(found.stem for found in folder.glob("*.toml")))
        raise UnknownNameError(f"No bundled project is called {name!r}; there is {known}.")
    return path


def load(path: str | Path) -> System:
    """Read a project file.

    Args:
        path: TOML file, or `bundled:hume`; relative paths in it start at its folder.

    Returns:
        The system.

    Raises:
        FileError: the file cannot be read.
        ProjectError: it is not TOML, too large, or a key is missing, unknown or wrong.
    """
    path = resolve_project(path)
    content = _read(path)
    project = parse_project(content, path)
    try:
        return _system(project, path, content.decode("utf-8"))
    except (ProjectError, FileError):
        raise
    except SealagError as error:
        raise ProjectError(f"{path}: {error}") from error


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > LARGEST_PROJECT_BYTES:
            raise ProjectError(
                f"{path} has {path.stat().st_size / 1e6:.1f} MB; a project file has at most "
                f"{LARGEST_PROJECT_BYTES / 1e6:.0f} MB."
            )
        return path.read_bytes()
    except OSError as error:
        raise FileError(
            f"The project file {path} cannot be read: {error.strerror or error}."
        ) from error


def parse_project(content: bytes, path: Path) -> Any:
    """Check a project file's text against the schema.

    Args:
        content: TOML, UTF-8.
        path: what messages call it.

    Returns:
        The parsed `Project`.

    Raises:
        ProjectError: the first thing that is wrong, with its key and what would be right.
    """
    from pydantic import ValidationError

    try:
        data = tomllib.loads(content.decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ProjectError(f"{path} is not TOML: {error}.") from error
    try:
        return Project.model_validate(data)
    except ValidationError as error:
        raise ProjectError(_first_problem(error.errors(), path)) from error


def _first_problem(problems: list[Any], path: Path) -> str:
    first = problems[0]
    place = [str(part) for part in first["loc"]]
    kinds = {"constant", "sinusoid", "table", "samples", "paper", "flat", "rough", "stairs"}
    key = ".".join(
        part for part in place if part not in kinds and part != "list[constrained-float]"
    )
    found, more = first.get("input"), len({tuple(p["loc"]) for p in problems}) - 1
    rest = f" ({more} more problem{'s' * (more > 1)} in the file.)" if more else ""
    match first["type"]:
        case "missing":
            return f"{path}: the key {key} is missing.{rest}"
        case "extra_forbidden":
            return f"{path}: the key {key} is not known; check its spelling and section.{rest}"
    if isinstance(found, str) and found.startswith("FILL"):
        return f"{path}: {key} is still to be filled in ({found}).{rest}"
    shown = repr(found) if len(repr(found)) < 60 else f"a {type(found).__name__}"
    unit = " (a delay in ms: was another unit meant?)" if key.endswith("_ms") else ""
    need = first["msg"].replace("Input should", "it should").rstrip(".")
    return f"{path}: {key} is {shown}; {need}{unit}.{rest}"


def _system(project: Any, path: Path, text: str) -> System:
    folder = path.parent
    robot = load_robot(
        resolve_urdf(project.robot.urdf, relative_to=folder),
        floating_base=project.robot.base == "floating",
        actuated=project.robot.actuated,
    )
    contacts = tuple(
        Contact(frame=robot.check_frame(c.frame), kind=ContactKind(c.kind))
        for c in project.contacts
    )
    hierarchy = Hierarchy(
        tasks=tuple(_task(section) for section in project.tasks),
        form=StiffnessForm(project.controller.stiffness_form),
        task_inertia=TaskInertia(project.controller.task_inertia),
    )
    hierarchy.gain(robot)
    posture = robot.configuration(
        project.posture.joints,
        base_position=project.posture.base_position,
        base_quaternion=project.posture.base_quaternion_xyzw,
    )
    return System(
        name=path.stem,
        robot=robot,
        actuators=_actuators(project.actuators, robot, path),
        hierarchy=hierarchy,
        contacts=contacts,
        posture=posture,
        feedback=Feedback(project.controller.feedback),
        gravity=GravityCompensation(project.controller.gravity),
        task_error=TaskError(project.controller.task_error),
        tank=Tank(
            flow=TankFlow(project.controller.tank_flow),
            energy=project.controller.tank_energy_j,
            rate=project.controller.tank_rate,
        ),
        criterion=Criterion(project.controller.criterion),
        delays=_delays(project.delays, folder, path),
        motion_file=folder / project.motion.file if project.motion else None,
        sha256=hashlib.sha256(text.encode()).hexdigest(),
        simulation=project.simulation,
        walking=walking_of(project.walking, robot),
        text=text,
    )


def _task(section: Any) -> Task:
    axes = tuple(_AXES[axis] for axis in section.axes)
    if section.kind == "orientation":
        axes = tuple(axis - 3 if axis >= 3 else axis for axis in axes)
    return Task(
        name=section.name,
        kind=TaskKind(section.kind),
        stiffness=np.asarray(section.stiffness, dtype=float),
        frame=section.frame,
        joints=tuple(section.joints),
        axes=axes,
        priority=section.priority,
    )


def _actuators(section: Any, robot: Robot, path: Path) -> Actuators:
    for name in section.joint:
        robot.joint_index(name)
    default = section.default.model_dump(exclude_none=True)
    columns: dict[str, list[float]] = {}
    every = [
        {**default, **section.joint[name].model_dump(exclude_none=True)}
        if name in section.joint
        else default
        for name in robot.joints
    ]
    for key in _REQUIRED:
        for name, values in zip(robot.joints, every, strict=True):
            if key not in values:
                raise ProjectError(
                    f"{path}: {key} of joint {name} is missing; "
                    f"give it in [actuators.default] or [actuators.joint.{name}]."
                )
    optional = {key for values in every for key in values}
    for key in optional:
        fallback = np.inf if key in {"torque_limit", "velocity_limit", "torque_bandwidth"} else 0.0
        columns[key] = [values.get(key, fallback) for values in every]
    return actuators(robot.joints, **columns)


def _delays(section: Any, folder: Path, path: Path) -> Delays:
    return Delays(
        central=_connection(section, "central", folder, path),
        embedded=_connection(section, "embedded", folder, path),
        sample_time=section.sample_time_ms * 1e-3,
        embedded_period=section.embedded_period_ms * 1e-3,
        delayed_torque_feedback=section.delayed_torque_feedback,
    )


def _connection(section: Any, name: str, folder: Path, path: Path) -> RoundTrip:
    """A connection from its round trip, or from both of its ways."""
    whole, up, down = (getattr(section, f"{name}_{way}") for way in ("round_trip", "up", "down"))
    if whole is not None and up is None and down is None:
        return RoundTrip.halved(_signal(whole, folder), **_packets(whole))
    if whole is None and up is not None and down is not None:
        return RoundTrip(
            **{
                way: Link(delay=_signal(keys, folder), **_packets(keys))
                for way, keys in (("up", up), ("down", down))
            }
        )
    said = "missing" if whole is None else "given besides one of its ways"
    raise ProjectError(
        f"{path}: the key delays.{name}_round_trip is {said}; give it alone, or both {name}_up and "
        f"{name}_down."
    )


def _packets(keys: Any) -> dict[str, Any]:
    return {
        "jitter": keys.jitter_ms * 1e-3,
        "loss": keys.packet_loss,
        "max_burst": keys.max_burst,
        "order": PacketOrder(keys.order),
    }


def _signal(section: Any, folder: Path) -> DelaySignal:
    match section.kind:
        case "constant":
            return Constant(section.value_ms * 1e-3)
        case "sinusoid":
            return Sinusoid(
                mean=section.mean_ms * 1e-3,
                amplitude=section.amplitude_ms * 1e-3,
                angular_frequency=section.angular_frequency_rad_s,
                phase=section.phase_rad,
            )
        case "table":
            return Table(time=np.asarray(section.time_s), delay=np.asarray(section.delay_ms) * 1e-3)
        case _:
            return _samples(section, folder)


def _samples(section: Any, folder: Path) -> DelaySignal:
    path = folder / section.file
    try:
        values = np.loadtxt(path, ndmin=1)
    except OSError as error:
        raise FileError(f"The delay samples {path} cannot be read: {error}.") from error
    except ValueError as error:
        raise ProjectError(f"{path} is not one number (ms) a line: {error}.") from error
    return measured(values * 1e-3, period=section.period_s, quantile=section.quantile)
