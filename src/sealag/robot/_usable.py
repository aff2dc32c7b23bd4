"""Which joints can have actuators: the others are left out, each with its reason."""

from pathlib import Path
from typing import NamedTuple

from sealag.errors import RobotError
from sealag.robot._load import Description, not_actuated, reduce_model, weak_joints
from sealag.robot._mimic import couple
from sealag.robot._urdf import ROOT_JOINT


class Usable(NamedTuple):
    """The joints of a robot that can have actuators.

    Attributes:
        joints: their names; mimic joints are not among them.
        skipped: why another joint cannot have one, by its name.
    """

    joints: list[str]
    skipped: dict[str, str]


def usable_joints(said: Description, path: Path) -> Usable:
    """Leave out joints until those that are left can all be actuated.

    What moves almost nothing is found with all other joints free, and again without it: a chain of
    links without inertia loses its joints from its end.

    Args:
        said: what the file says.
        path: what messages call it.

    Raises:
        RobotError: no joint is left, or the robot has no mass or is singular as a whole.
    """
    skipped = {name: str(error).rstrip(".") for name, error in said.astray.items()}
    model = said.model
    for name in said.movable:
        problem = not_actuated(model.joints[model.getJointId(name)])
        if problem and name not in said.followers:
            skipped[name] = problem
    while True:
        names = [name for name in said.movable if name not in {**skipped, **said.followers}]
        if skipped and not names:
            reasons = "; ".join(f"{name} {why}" for name, why in skipped.items())
            raise RobotError(f"{path}: no joint can be actuated: {reasons}.")
        reduced, followers = reduce_model(said, path, actuated=names)
        weak = weak_joints(reduced, couple(reduced, followers), path)
        if not weak or ROOT_JOINT in weak:
            return Usable(names, skipped)
        skipped |= {
            name: f"moves almost no inertia (link {link}); correct <inertial> there"
            for name, link in weak.items()
        }
