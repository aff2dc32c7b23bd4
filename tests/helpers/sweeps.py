"""A small project to sweep over: an arm of two joints that is certified in milliseconds."""

from pathlib import Path

from helpers.toml import to_toml

_URDF = """<robot name="two">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.02 0 -0.2"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.035" iyz="0" izz="0.02"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.01 0.01 -0.15"/><mass value="1.3"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.021" iyz="0" izz="0.01"/></inertial></link>
  <link name="tip"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="80" velocity="8"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="90" velocity="9"/></joint>
  <joint name="t" type="fixed"><parent link="lower"/><child link="tip"/>
    <origin xyz="0 0 -0.3"/></joint>
</robot>"""

PROJECT = {
    "robot": {"urdf": "two.urdf", "base": "fixed"},
    "posture": {"joints": {"j1": 0.4, "j2": 0.5}},
    "actuators": {
        "default": {
            "spring_stiffness": 300.0,
            "rotor_inertia": 0.07,
            "inertia_shaping": 0.6,
            "motor_damping": 9.0,
        },
    },
    "controller": {"feedback": "motor", "gravity": "planned"},
    "tasks": [
        {"name": "hand", "kind": "position", "frame": "tip", "axes": ["x", "z"], "stiffness": 40.0},
    ],
    "delays": {
        "central_round_trip": {"kind": "constant", "value_ms": 4.0},
        "embedded_round_trip": {"kind": "constant", "value_ms": 1.0},
    },
}


def two_joints(folder: Path) -> Path:
    """Write the arm and its project; return the project's path."""
    (folder / "two.urdf").write_text(_URDF)
    path = folder / "two.toml"
    path.write_text("# an arm\n" + to_toml(PROJECT))
    return path
