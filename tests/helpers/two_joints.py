"""An arm of two joints, certified in milliseconds: its robot, and projects of it."""

from pathlib import Path
from typing import Any

from helpers.toml import to_toml

URDF = """<robot name="two">
  <link name="base"><inertial><mass value="3"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.12" iyz="0" izz="0.09"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.02 0 -0.2"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.035" iyz="0" izz="0.02"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.01 0.01 -0.15"/><mass value="1.3"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.021" iyz="0" izz="0.01"/></inertial></link>
  <link name="tip"/><link name="side"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="{effort}" velocity="{velocity}"/>
    <dynamics damping="{damping}" friction="{friction}"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 -0.4"/><axis xyz="0 0.8 0.6"/>
    <limit lower="-3" upper="3" effort="90" velocity="9"/></joint>
  <joint name="t" type="fixed"><parent link="lower"/><child link="tip"/>
    <origin xyz="0 0 -0.3"/></joint>
  <joint name="s" type="fixed"><parent link="base"/><child link="side"/>
    <origin xyz="0.1 0.1 0"/></joint>
</robot>"""
PLAIN = {"effort": 80, "velocity": 8, "damping": 0, "friction": 0}

CONSTANT = {"kind": "constant", "value_ms": 4.0}
BASE: dict[str, Any] = {
    "robot": {"urdf": "two.urdf", "base": "fixed"},
    "posture": {"joints": {"j1": 0.4, "j2": 0.5}},
    "actuators": {
        "default": {
            "spring_stiffness": 300.0,
            "rotor_inertia": 0.07,
            "inertia_shaping": 0.6,
            "motor_damping": 9.0,
        },
        "joint": {"j2": {"spring_stiffness": 210.0}},
    },
    "controller": {"feedback": "static_joint", "gravity": "feedback"},
    "tasks": [
        {"name": "hand", "kind": "position", "frame": "tip", "axes": ["x", "z"], "stiffness": 40.0},
        {"name": "rest", "kind": "posture", "stiffness": 9.0, "priority": 2},
    ],
    "delays": {
        "central_round_trip": CONSTANT,
        "embedded_round_trip": {"kind": "constant", "value_ms": 1.0},
        "sample_time_ms": 1.0,
    },
}
PROJECT: dict[str, Any] = {
    **BASE,
    "controller": {"feedback": "motor", "gravity": "planned"},
    "tasks": BASE["tasks"][:1],
}
"""With one task."""


def two_joints(folder: Path) -> Path:
    """Write the robot and the project with one task; return the project's path."""
    (folder / "two.urdf").write_text(URDF.format(**PLAIN))
    path = folder / "two.toml"
    path.write_text("# an arm\n" + to_toml(PROJECT))
    return path
