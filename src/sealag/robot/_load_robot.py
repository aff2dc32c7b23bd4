"""From a file or a model to a robot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from sealag.robot._find import resolve_urdf
from sealag.robot._load import check_inertias, describe_model, read_model, reduce_model
from sealag.robot._mimic import UNLIMITED, couple, position_limits
from sealag.robot._robot import Robot
from sealag.robot._usable import Usable, usable_joints
from sealag.typing import Array


def load_robot(
    urdf: str | Path | pin.Model,
    *,
    floating_base: bool,
    actuated: Sequence[str] | None = None,
    relative_to: Path = Path(),
    skip_unusable: bool = False,
) -> Robot:
    """Read a robot from a URDF, a xacro or MJCF file, or a Pinocchio model; meshes are not needed.

    What kind of file it is, its content tells. Xacro files are expanded by the package xacro, with
    their arguments' defaults. MJCF files need <inertial> in their bodies.

    Names with undeclared prefixes (`drake:acceleration`) and all that is not of the dynamics are
    passed over. Position limits whose lower one is the larger are exchanged, and the robot's
    `remarks` say so.

    Args:
        urdf: a path, `bundled:hume.urdf`, `example-robot-data:<path below robots>`, or
            `package://<ROS package>/<path>`: the package is looked for in ROS_PACKAGE_PATH, in
            AMENT_PREFIX_PATH, and in the folders around the file that names it. Or a
            `pinocchio.Model`, which is copied; its gravity is 9.81 m/s².
        floating_base: whether the root link moves freely. Where the file's own root joint is
            floating, that joint is the base's; it is locked if this is False.
        actuated: names of the actuated joints; the other movable joints are locked at their
            neutral position. None takes all that do not mimic another one. A joint that mimics an
            actuated one follows it, one that mimics another is locked where that puts it.
        relative_to: folder from which a relative path starts.
        skip_unusable: leave joints that cannot have an actuator out of `actuated`, which is None;
            the robot's `skipped` says why. They are locked.

    Returns:
        The robot; its `joints` are in the model's order, whatever the order of `actuated`.

    Raises:
        FileError: the file cannot be read.
        RobotError: it is no robot with physical inertias and joints of one degree of freedom, an
            actuated joint mimics another one, or moves almost no inertia; it is SDF, or MJCF with
            something that is not read.
        UnknownNameError: an actuated joint, a bundled robot, or a link or joint that a joint of the
            URDF names does not exist.
    """
    if isinstance(urdf, pin.Model):
        file, path = None, Path(urdf.name or "the model")
        said = describe_model(urdf, floating_base=floating_base)
    else:
        file = path = resolve_urdf(str(urdf), relative_to=relative_to)
        said = read_model(path, floating_base=floating_base)
    usable = Usable([], {})
    if skip_unusable and actuated is None:
        usable = usable_joints(said, path)
        actuated = usable.joints
    model, followers = reduce_model(said, path, actuated=actuated)
    coupling = couple(model, followers)
    check_inertias(model, coupling, path)
    count, n = len(coupling.offset), len(coupling.own)
    every = [str(name) for name in model.names[-count:]]
    names = tuple(every[k] for k in coupling.own)
    lower, upper = position_limits(model, coupling, path)
    ratio = np.abs(coupling.T[-count:, -n:])
    return Robot(
        name=model.name,
        urdf_path=file,
        urdf_sha256=said.sha256,
        floating_base=floating_base,
        joints=names,
        followers=followers,
        skipped=usable.skipped,
        remarks=said.remarks,
        position_lower=lower,
        position_upper=upper,
        sliding=np.array([model.joints[model.getJointId(j)].shortname()[10] == "P" for j in names]),
        velocity_limit=_limit(model.velocityLimit[-count:][coupling.own]),
        effort_limit=_limit(model.effortLimit[-count:][coupling.own]),
        rotor_inertia=np.square(ratio).T @ [said.rotors[name] for name in every],
        damping=np.square(ratio).T @ model.damping[-count:],
        friction=ratio.T @ model.upperDryFrictionLimit[-count:],
        mass=float(sum(inertia.mass for inertia in model.inertias[1:])),
        _model=model,
    )


def _limit(values: Array) -> Array:
    """Limits as the URDF gives them; absent or huge ones are infinite."""
    array = np.array(values, dtype=float)
    array[~(np.abs(array) < UNLIMITED)] = np.inf
    return array
