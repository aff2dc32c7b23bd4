"""What the black box reads of a project file: the plant, never the law."""

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sealag

ACTUATOR_DEFAULTS = {
    "spring_damping": 0.0,
    "viscous_friction": 0.0,
    "torque_bandwidth": float("inf"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The physical part of a project file, SI units.

    Attributes:
        path: the project file.
        urdf: the robot's URDF.
        floating: whether the base moves freely.
        actuated: names of the actuated joints; None for all that mimic no other.
        base_position: (3,) m.
        base_quaternion: (4,) x, y, z, w.
        joints: joint positions by name; the others are 0.
        actuator_default: keys of [actuators.default].
        actuator_joint: keys of [actuators.joint.<name>].
        contacts: frame and number of held rows, 3 or 6.
        feedback: what the law is taken at.
        gravity: what it compensates, and where.
        tank_pays: whether a tank, if there is one, holds energy and moves at a rate.
        torque_feedback_delay: e, s; 0 unless the design delays its inner torque feedback.
    """

    path: Path
    urdf: Path
    floating: bool
    actuated: tuple[str, ...] | None
    base_position: tuple[float, ...]
    base_quaternion: tuple[float, ...]
    joints: dict[str, float]
    actuator_default: dict[str, float]
    actuator_joint: dict[str, dict[str, float]]
    contacts: tuple[tuple[str, int], ...]
    feedback: str
    gravity: str
    tank_pays: bool
    torque_feedback_delay: float

    def actuator(self, joint: str, key: str) -> float:
        """Return a joint's actuator value.

        Args:
            joint: its name.
            key: as in the project file.
        """
        of_joint = self.actuator_joint.get(joint, {})
        if key in of_joint:
            return float(of_joint[key])
        return float(self.actuator_default.get(key, ACTUATOR_DEFAULTS.get(key, float("nan"))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Springs, motors and torque loops, (n,) each, in the order of the joints."""

    K: np.ndarray
    B: np.ndarray
    beta: np.ndarray
    D: np.ndarray
    D_s: np.ndarray
    viscous: np.ndarray
    bandwidth: np.ndarray
    limit: np.ndarray

    @classmethod
    def of(cls, design: Design, joints: list[str], efforts: np.ndarray) -> "Drive":
        """Return the drives of a design.

        Args:
            design: the project file.
            joints: names, in order.
            efforts: (n,) the URDF's limits, Nm, where the design gives none.
        """
        keys = {
            "K": "spring_stiffness",
            "B": "rotor_inertia",
            "beta": "inertia_shaping",
            "D": "motor_damping",
            "D_s": "spring_damping",
            "viscous": "viscous_friction",
            "bandwidth": "torque_bandwidth",
            "limit": "torque_limit",
        }
        drives = {
            name: np.array([design.actuator(joint, key) for joint in joints])
            for name, key in keys.items()
        }
        unlimited = np.isnan(drives["limit"])
        drives["limit"] = np.where(unlimited, efforts, drives["limit"])
        return cls(**drives)


def read_design(path: str | Path) -> Design:
    """Read the physical part of a project file.

    Args:
        path: TOML.
    """
    path = Path(path)
    data = tomllib.loads(path.read_text())
    robot, posture, law = data["robot"], data.get("posture", {}), data["controller"]
    actuators, delays = data["actuators"], data["delays"]
    rows = {"point": 3, "surface": 6}
    late = delays.get("delayed_torque_feedback", False)
    return Design(
        path=path,
        urdf=_urdf(robot["urdf"], path.parent),
        floating=robot["base"] == "floating",
        actuated=tuple(robot["actuated"]) if "actuated" in robot else None,
        base_position=tuple(posture.get("base_position", (0.0, 0.0, 0.0))),
        base_quaternion=tuple(posture.get("base_quaternion_xyzw", (0.0, 0.0, 0.0, 1.0))),
        joints=dict(posture.get("joints", {})),
        actuator_default=dict(actuators.get("default", {})),
        actuator_joint=dict(actuators.get("joint", {})),
        contacts=tuple(
            (c["frame"], rows[c.get("kind", "point")]) for c in data.get("contacts", [])
        ),
        feedback=law["feedback"],
        gravity=law["gravity"],
        tank_pays=all(law.get(key, 1.0) > 0.0 for key in ("tank_energy_j", "tank_rate")),
        torque_feedback_delay=_embedded_up(delays) if late else 0.0,
    )


def _embedded_up(delays: dict[str, Any]) -> float:
    """The way up of the embedded connection, s: constants only."""
    way = delays.get("embedded_up")
    whole = way if way is not None else delays["embedded_round_trip"]
    if whole["kind"] != "constant":
        raise NotImplementedError("the black box delays torque feedback by a constant only")
    return float(whole["value_ms"]) * 1e-3 * (1.0 if way is not None else 0.5)


def _urdf(text: str, folder: Path) -> Path:
    if text.startswith("bundled:"):
        return Path(sealag.__file__).parent / "data" / text.removeprefix("bundled:")
    if text.startswith("example-robot-data:"):
        return example_robots() / text.removeprefix("example-robot-data:")
    return folder / text


def example_robots() -> Path:
    """Return the folder of example-robot-data's robots."""
    for entry in sys.path:
        for share in (Path(entry) / "cmeel.prefix" / "share", Path(entry).parent / "share"):
            if (share / "example-robot-data" / "robots").is_dir():
                return share / "example-robot-data" / "robots"
    return Path(sys.prefix) / "share" / "example-robot-data" / "robots"
