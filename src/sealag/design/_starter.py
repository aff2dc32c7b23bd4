"""A commented project file for a robot, to be filled in."""

from pathlib import Path

from sealag.robot import Robot, load_robot

_HEAD = """\
# sealag project for {name}: what `sealag certify` needs to know besides the URDF.
# Values that begin with FILL are not known from the URDF; replace each by a number.
# SI units throughout; delays are in ms, as their keys say.

[robot]
urdf = "{urdf}"
base = "{base}"          # "floating" or "fixed"
actuated = [             # joints with an actuator; others are locked at 0, mimics too
{actuated}
]

[posture]                # certified when no motion is given (--motion)
{base_pose}
[posture.joints]         # rad or m; those left out are 0
{positions}

[actuators.default]
spring_stiffness = "FILL: K, Nm/rad"
rotor_inertia = {rotor}
inertia_shaping = "FILL: beta = B_s / B; 1 without torque feedback"
motor_damping = "FILL: D_theta, Nms/rad, embedded and not delayed"
# Joints that differ:
# [actuators.joint.{joint}]
# spring_stiffness = 350.0
{contacts}
[controller]
feedback = "motor"             # motor | static_joint | static_joint_tank | joint
gravity = "planned"            # feedback | planned | none
stiffness_form = "symmetric"   # symmetric | published | force
criterion = "certified"        # certified | published

[[tasks]]
name = "posture"
kind = "posture"               # com | position | orientation | pose | posture
stiffness = "FILL: 1/s^2, times the task inertia"
priority = 1

# Delays are constant, sinusoid (mean_ms, amplitude_ms, angular_frequency_rad_s), table (time_s,
# delay_ms) or samples (file of measured ones in ms, period_s), each with jitter_ms, packet_loss,
# max_burst and order ("fifo", "newest", "arrival") if packets are late or lost. Instead of a round
# trip both of its ways may be given: central_up and central_down, embedded_up and embedded_down.
[delays]
central_round_trip = {{ kind = "constant", value_ms = "FILL: T_H, ms" }}
embedded_round_trip = {{ kind = "constant", value_ms = "FILL: T_L, ms" }}
sample_time_ms = 1.0           # period of the central controller; its hold is added
# embedded_period_ms = 0.5     # at which the robot's side sends and looks; added for each link
"""


def starter_project(urdf: str | Path, *, floating_base: bool = False) -> str:
    """Write a starter project file for a robot, with its own joints in it.

    Args:
        urdf: the robot, as `load_robot` takes it.
        floating_base: whether the root link moves freely.

    Returns:
        TOML text that certifies once each FILL is replaced.

    Raises:
        FileError: the URDF cannot be read.
        RobotError: it is not a usable robot.
    """
    robot = load_robot(urdf, floating_base=floating_base)
    rotor = robot.rotor_inertia
    known = bool((rotor > 0.0).all())
    return _HEAD.format(
        name=robot.name,
        urdf=str(urdf).replace("\\", "/"),
        base="floating" if floating_base else "fixed",
        actuated="\n".join(f'  "{name}",' for name in robot.joints),
        base_pose=(
            "base_position = [0.0, 0.0, 1.0]\nbase_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]\n"
            if floating_base
            else ""
        ),
        positions="\n".join(
            f"{_key(name)} = {_middle(robot, k):.4g}" for k, name in enumerate(robot.joints)
        ),
        rotor=f"{rotor.min():.6g}" if known else '"FILL: B reflected to the joint, kg m^2"',
        joint=_key(robot.joints[0]),
        contacts=_contacts(robot) if floating_base else "",
    )


def _key(name: str) -> str:
    plain = name.replace("_", "").replace("-", "")
    return name if plain.isascii() and plain.isalnum() else f'"{name}"'


def _middle(robot: Robot, index: int) -> float:
    """0 where the limits allow it, else the middle of the range."""
    low, high = float(robot.position_lower[index]), float(robot.position_upper[index])
    return 0.0 if low <= 0.0 <= high else (low + high) / 2.0


def _contacts(robot: Robot) -> str:
    frames = robot.link_names()
    feet = [name for name in frames if any(w in name.lower() for w in ("foot", "sole", "toe"))]
    lines = ["", "# Frames that the ground holds: a point (3 forces) or a surface (6)."]
    for name in feet[:4]:
        lines += ["[[contacts]]", f'frame = "{name}"', 'kind = "point"']
    if not feet:
        lines += ["# [[contacts]]", f'# frame = "{frames[-1]}"', '# kind = "point"']
    return "\n".join([*lines, ""])
