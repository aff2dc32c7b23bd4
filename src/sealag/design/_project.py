"""The project file: read, checked key by key, and turned into a System."""

import math
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sealag.actuation import Actuators
from sealag.design._delays import delays_of
from sealag.design._design import Source
from sealag.design._matrices import matrices_of
from sealag.design._plain_words import first_problem, named
from sealag.design._program import program_of
from sealag.design._schema import (
    AXES,
    JointPdKeys,
    MatrixKeys,
    ProgramKeys,
    Project,
    SamplesDelay,
    WholeBodyKeys,
)
from sealag.design._system import System
from sealag.design._walking import walking_of
from sealag.errors import FileError, InputError, ProjectError
from sealag.files import bundled, read_whole
from sealag.passivity import Criterion
from sealag.robot import Contact, ContactKind, Robot, load_robot
from sealag.typing import Array
from sealag.whole_body import (
    GravityCompensation,
    Law,
    Signal,
    StiffnessForm,
    Tank,
    TankFlow,
    Task,
    TaskError,
    TaskInertia,
    TaskKind,
)

LARGEST_PROJECT_BYTES = 1_000_000
_TOO_LARGE = "has too many digits; TOML's whole numbers have at most 19"
_REQUIRED = ("spring_stiffness", "rotor_inertia", "motor_damping", "inertia_shaping")


def load(path: str | Path, *, text: str | None = None, beside: System | None = None) -> System:
    """Read a project file.

    Args:
        path: TOML file, or `bundled:hume`; relative paths in it start at its folder.
        text: what the file is to say, before it does so; its own text if None.
        beside: a design of the same file with another text, whose robot serves once more where it
            is the same; the files that the text names have not changed since.

    Returns:
        The system.

    Raises:
        UnknownNameError: no bundled project has this name.
        FileError: the file cannot be read.
        ProjectError: it is not TOML, too large, or a key is missing, unknown or wrong.
    """
    path = _resolved(path)
    content = read_whole(path, what="The project file", largest=LARGEST_PROJECT_BYTES)
    content = content if text is None else text.encode()
    with named(path, ""):
        project = _parsed(content, path)
        return _system(project, path, content.decode("utf-8-sig"), beside)


def loaded(project: System | str | Path) -> System:
    """Return a system as it is, or the one that a project file describes.

    Args:
        project: the system, or its file as `load` takes it.

    Raises:
        InputError: it is neither; otherwise as `load` raises it.
    """
    if isinstance(project, System):
        return project
    if not isinstance(project, str | Path):
        raise InputError(f"project is {project!r}; a System or a project file's path is needed.")
    return load(project)


def _resolved(text: str | Path) -> Path:
    """The path of a project file, which may be a bundled one."""
    if not str(text).startswith("bundled:"):
        return Path(text)
    name = str(text).removeprefix("bundled:").removesuffix(".toml")
    return bundled(name, ending=".toml", what="project")


def _parsed(content: bytes, path: Path) -> Project:
    """A project file's text, checked against the schema; the first thing that is wrong is an
    error."""
    from pydantic import ValidationError

    try:
        data = tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ProjectError(f"{path} is not TOML: line {line} is not in UTF-8.") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ProjectError(f"{path} is not TOML: {error}.") from error
    except ValueError as error:  # Python reads no whole numbers with thousands of digits
        raise ProjectError(f"{path}: a whole number {_TOO_LARGE}.") from error
    for key, value in _leaves(data):
        if isinstance(value, int) and value.bit_length() > 63:
            raise ProjectError(f"{path}: {key} {_TOO_LARGE}.")
    try:
        return Project.model_validate(data)
    except ValidationError as error:
        key, words = first_problem(error.errors(), data, path=path)
        raise ProjectError(words).at(path, key) from error


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """What stands in a parsed file besides tables and lists, each with its key."""
    if isinstance(value, dict):
        for name, entry in value.items():
            yield from _leaves(entry, f"{key}.{name}".removeprefix("."))
    elif isinstance(value, list):
        for number, entry in enumerate(value, start=1):
            yield from _leaves(entry, f"{key} (entry {number})")
    else:
        yield key, value


def _system(project: Project, path: Path, text: str, beside: System | None) -> System:
    folder = path.parent
    robot = _robot(project, path, beside)
    law = _law(project, robot, path)
    law.gain(robot)
    actuators = _actuators(project.actuators, robot, path)
    if isinstance(project.controller, JointPdKeys) and project.controller.damping_at == "drive":
        kd = _by_joint(project.controller.kd, robot, path, "controller.kd")
        actuators = replace(actuators, motor_damping=actuators.motor_damping + kd)
    program, program_file = None, None
    match project.controller:
        case ProgramKeys() as keys:
            program_file = folder / keys.file
            with named(path, "controller.file"):
                program = program_of(program_file, keys.function)
        case MatrixKeys() as keys:
            program_file = folder / keys.file if keys.file is not None else None
            with named(path, "controller"):
                program = matrices_of(keys, robot, folder, project.delays.sample_time_ms * 1e-3)
    with named(path, "simulation.pushes"):
        for push in project.simulation.pushes:
            robot.check_frame(push.frame)
    motion_file = None
    if project.motion:
        motion_file = folder / project.motion.file
        if not motion_file.is_file():
            raise FileError(
                f"{path}: motion.file is {project.motion.file!r}; there is no such file."
            )
    samples = [keys.file for _, keys in project.delays if isinstance(keys, SamplesDelay)]
    files = [path, robot.urdf_path, motion_file, program_file, *(folder / name for name in samples)]
    return System(
        name=path.stem,
        robot=robot,
        actuators=actuators,
        law=law,
        program=program,
        contacts=_contacts(project.contacts, robot, path),
        posture=_posture(project.posture, robot, path),
        criterion=_criterion(project.controller),
        delays=delays_of(project.delays, folder, path),
        simulation=project.simulation,
        walking=walking_of(project.walking, robot),
        source=Source(
            text=text,
            project=project,
            files=tuple(file for file in files if file is not None),
            motion_file=motion_file,
        ),
    )


def _robot(project: Project, path: Path, beside: System | None) -> Robot:
    known = None if beside is None else beside.source
    if beside and known and (known.files[0], known.project.robot) == (path, project.robot):
        return beside.robot
    with named(path, "robot"):
        return load_robot(
            project.robot.urdf,
            floating_base=project.robot.base == "floating",
            actuated=project.robot.actuated,
            relative_to=path.parent,
        )


def _law(project: Project, robot: Robot, path: Path) -> Law:
    """The law of [controller], with the [[tasks]] of a whole-body one."""
    keys = project.controller
    if not isinstance(keys, WholeBodyKeys) and project.tasks:
        raise ProjectError(
            f'{path}: [[tasks]] are given, but controller.kind is "{keys.kind}", which has none; '
            'remove them, or let the kind be "wbosc".'
        )
    if isinstance(keys, ProgramKeys | MatrixKeys):
        nothing = Task(name="none", kind=TaskKind.POSTURE, stiffness=np.zeros(robot.n))
        gravity = GravityCompensation.NONE
        if isinstance(keys, MatrixKeys):
            gravity = GravityCompensation.PLANNED
        return Law(tasks=(nothing,), gravity=gravity)
    if isinstance(keys, JointPdKeys):
        late = keys.damping_at == "controller"
        joints = Task(
            name="joints",
            kind=TaskKind.POSTURE,
            stiffness=_by_joint(keys.kp, robot, path, "controller.kp"),
            damping=_by_joint(keys.kd, robot, path, "controller.kd") if late else 0.0,
        )
        return Law(
            tasks=(joints,),
            signal=Signal.named(keys.feedback),
            gravity=GravityCompensation(keys.gravity),
            stiffness_form=StiffnessForm.FORCE,
        )
    if not project.tasks:
        raise ProjectError(f"{path}: the key tasks is missing: [[tasks]] say what is controlled.")
    return Law(
        tasks=tuple(_task(section) for section in project.tasks),
        signal=_fed_back(keys),
        gravity=GravityCompensation(keys.gravity),
        stiffness_form=StiffnessForm(keys.stiffness_form),
        task_inertia=TaskInertia(keys.task_inertia),
        task_error=TaskError(keys.task_error),
    )


def _by_joint(given: float | dict[str, float], robot: Robot, path: Path, key: str) -> Array:
    """One number for all joints, or a table with one for each (n,)."""
    if not isinstance(given, dict):
        return np.full(robot.n, float(given))
    with named(path, key):
        for name in given:
            robot.joint_index(name)
    missing = [name for name in robot.joints if name not in given]
    if missing:
        raise ProjectError(
            f"{path}: {key} has no number for joint {missing[0]} ({len(missing)} in all); give "
            "one for each joint, or one number for all."
        )
    return np.array([given[name] for name in robot.joints])


def _criterion(keys: Any) -> Criterion:
    return Criterion(keys.criterion) if isinstance(keys, WholeBodyKeys) else Criterion.CERTIFIED


def _fed_back(section: Any) -> Signal:
    """The signal of [controller], with the tank's settings where it is the tank."""
    signal = Signal.named(section.feedback)
    if isinstance(signal, Tank):
        return Tank(
            energy=section.tank_energy_j,
            rate=section.tank_rate,
            flow=TankFlow(section.tank_flow),
        )
    return signal


def _contacts(sections: Any, robot: Robot, path: Path) -> tuple[Contact, ...]:
    if sections and not robot.floating_base:
        raise ProjectError(
            f'{path}: robot.base is "fixed", but [[contacts]] hold frames to the ground as well; '
            'remove them, or let the base be "floating".'
        )
    frames = [robot.check_frame(section.frame) for section in sections]
    for frame in frames:
        if frames.count(frame) > 1:
            raise ProjectError(f"{path}: [[contacts]] list the frame {frame} twice; once is right.")
    return tuple(Contact(frame=c.frame, kind=ContactKind(c.kind)) for c in sections)


def _posture(section: Any, robot: Robot, path: Path) -> Array:
    """The configuration of [posture], which must be one and lie inside the joints' limits."""
    given = section.model_fields_set & {"base_position", "base_quaternion_xyzw"}
    if given and not robot.floating_base:
        raise ProjectError(
            f'{path}: posture.{min(given)} is given, but robot.base is "fixed", so that the base '
            'stays where the URDF has it; remove the key, or let the base be "floating".'
        )
    length = float(np.linalg.norm(section.base_quaternion_xyzw))
    if abs(length - 1.0) > robot.UNIT_TOLERANCE:
        raise ProjectError(
            f"{path}: posture.base_quaternion_xyzw has length {length:.4g}; 1 is right, in the "
            "order x, y, z, w."
        )
    with named(path, "posture.joints"):
        q = robot.configuration(
            section.joints,
            base_position=section.base_position,
            base_quaternion=section.base_quaternion_xyzw,
        )
        robot.require_within_limits(q)
    return q


def _task(section: Any) -> Task:
    axes = tuple(AXES.index(axis) for axis in section.axes)
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
        damping=np.asarray(section.damping, dtype=float),
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
    optional = {key for values in every for key in values} - set(_REQUIRED)
    for key in _REQUIRED:
        columns[key] = [values[key] for values in every]
    for key in optional:
        columns[key] = [values.get(key, _left_out(key)) for values in every]
    return Actuators.of_robot(robot, **columns)


def _left_out(key: str) -> float:
    """What stands for a key that is given for other joints only; NaN for what the URDF states."""
    if key in ("torque_limit", "velocity_limit", "coulomb_friction"):
        return math.nan
    return math.inf if key == "torque_bandwidth" else 0.0
