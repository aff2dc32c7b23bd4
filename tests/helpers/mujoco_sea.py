"""A MuJoCo model of a robot with series elastic actuators, as docs/theory section 12 sets it up.

Rotor: a hinge of its own with armature B_s and damping D_theta; spring: a fixed tendon between
rotor (+1) and joint (-1); held foot: a connect equality; delay: MuJoCo's own actuator delay.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from sealag.actuation import Actuators
from sealag.robot import Robot

_AXES = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}


def _numbers(values) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(values))


def _pose(placement) -> str:
    x, y, z, w = _quaternion(placement.rotation)
    return f'pos="{_numbers(placement.translation)}" quat="{w:.17g} {x:.17g} {y:.17g} {z:.17g}"'


def _quaternion(rotation):
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation).ravel())
    w, x, y, z = out
    return x, y, z, w


def _inertial(inertia) -> str:
    I = inertia.inertia
    full = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    return (
        f'<inertial pos="{_numbers(inertia.lever)}" mass="{inertia.mass:.17g}" '
        f'fullinertia="{_numbers(full)}"/>'
    )


def _axis(joint) -> tuple[str, str]:
    name = joint.shortname()
    kind = "slide" if "JointModelP" in name else "hinge"
    if name[-1] in _AXES:
        return kind, _AXES[name[-1]]
    return kind, _numbers(joint.extract().axis if hasattr(joint, "extract") else joint.axis)


def _body(model, index: int, sites: str, floating: bool, bearing: dict[str, float]) -> str:
    """XML of the body behind a joint and of everything on it."""
    name = model.names[index]
    if floating and index == 1:
        joint = "<freejoint/>"
    else:
        kind, axis = _axis(model.joints[index])
        damping = f'damping="{bearing.get(name, 0.0):.17g}"'
        joint = f'<joint name="{name}" type="{kind}" axis="{axis}" {damping}/>'
    children = "".join(
        _body(model, child, sites, floating, bearing)
        for child in range(index + 1, model.njoints)
        if model.parents[child] == index
    )
    placed = "".join(xml for parent, xml in sites if parent == index)
    return (
        f'<body name="{name}" {_pose(model.jointPlacements[index])}>{joint}'
        f"{_inertial(model.inertias[index])}{placed}{children}</body>"
    )


def model_xml(
    robot: Robot,
    actuators: Actuators,
    *,
    step: float,
    feet: tuple[str, ...] = (),
    delay: float = 0.0,
    friction: float | None = None,
    radius: float = 1e-3,
    integrator: str = "implicitfast",
    impedance: float = 0.9999,
    soft: float = 5e-4,
    pushed: str | None = None,
) -> str:
    """Return the MJCF of a robot: feet held by equalities, or each touching its plane of ground.

    The last three controls are the force on the origin of the pushed frame, world axes.
    """
    model = robot._model
    sites = []
    for k, foot in enumerate(feet):
        frame = model.frames[model.getFrameId(foot)]
        sites.append((frame.parentJoint, f'<site name="{foot}" {_pose(frame.placement)}/>'))
        if friction is not None:
            place = _numbers(frame.placement.translation)
            sites.append(
                (
                    frame.parentJoint,
                    f'<geom name="{foot}" type="sphere" size="{radius}" pos="{place}" '
                    f'contype="{2**k}" conaffinity="0" mass="0"/>',
                )
            )
    forces = ""
    if pushed is not None:
        frame = model.frames[model.getFrameId(pushed)]
        sites.append((frame.parentJoint, f'<site name="pushed" {_pose(frame.placement)}/>'))
        forces = "".join(
            f'<motor site="pushed" refsite="origin" gear="{_numbers(axis)} 0 0 0"/>'
            for axis in np.eye(3)
        )
    base = [i for i in range(1, model.njoints) if model.parents[i] == 0]
    bearing = dict(zip(robot.joints, robot.damping.tolist()))
    bodies = "".join(_body(model, i, sites, robot.floating_base, bearing) for i in base)
    rotors = "".join(
        f'<body name="rotor_{name}" pos="0 0 50"><inertial pos="0 0 0" mass="1e-6" '
        f'diaginertia="1e-12 1e-12 1e-12"/><joint name="rotor_{name}" axis="0 0 1" '
        f'armature="{actuators.shaped_inertia[i]:.17g}" '
        f'damping="{actuators.motor_damping[i]:.17g}"/></body>'
        for i, name in enumerate(robot.joints)
    )
    springs = "".join(
        f'<fixed stiffness="{actuators.spring_stiffness[i]:.17g}" springlength="0" '
        f'damping="{actuators.spring_damping[i]:.17g}"><joint '
        f'joint="rotor_{name}" coef="1"/><joint joint="{name}" coef="-1"/></fixed>'
        for i, name in enumerate(robot.joints)
    )
    # With more samples rounding of the time would let the delay jump by a step.
    late = f'delay="{delay}" nsample="{round(delay / step)}" interp="zoh"' if delay > 0 else ""
    motors = "".join(f'<motor joint="rotor_{name}" {late}/>' for name in robot.joints)
    anchors = "".join(f'<site name="anchor_{f}" pos="9 9 {9 + k}"/>' for k, f in enumerate(feet))
    held = "".join(
        f'<connect name="{f}" site1="{f}" site2="anchor_{f}" solref="-2500 -100" '
        f'solimp="{impedance} {impedance} 0.001" active="false"/>'
        for f in feet
    )
    floor = ""
    if friction is not None:
        floor = "".join(
            f'<geom name="ground_{f}" type="plane" size="9 9 1" friction="{friction} 0 0" '
            f'condim="{3 if friction else 1}" contype="0" conaffinity="{2**k}" priority="1" '
            f'solref="{soft} 1" solimp="{impedance} {impedance} 0.0001"/>'
            for k, f in enumerate(feet)
        )
    contact = "enable" if friction is not None else "disable"
    return (
        f'<mujoco><compiler angle="radian" boundmass="0" boundinertia="0" balanceinertia="false"/>'
        f'<option timestep="{step:.17g}" integrator="{integrator}" gravity="0 0 -9.81" '
        f'tolerance="1e-13" iterations="200" cone="elliptic" impratio="100">'
        f'<flag contact="{contact}" midphase="disable"/></option>'
        f'<worldbody><site name="origin" pos="0 0 0"/>'
        f"{floor}{anchors}{bodies}{rotors}</worldbody><tendon>{springs}</tendon>"
        f"<equality>{held}</equality><actuator>{motors}{forces}</actuator></mujoco>"
    )


@dataclass
class MujocoRobot:
    """A robot in MuJoCo, read and written in sealag's coordinates."""

    robot: Robot
    model: mujoco.MjModel
    data: mujoco.MjData

    @classmethod
    def build(cls, robot: Robot, actuators: Actuators, **options) -> "MujocoRobot":
        """Compile the model; options as in ``model_xml``."""
        model = mujoco.MjModel.from_xml_string(model_xml(robot, actuators, **options))
        return cls(robot=robot, model=model, data=mujoco.MjData(model))

    def _addresses(self, prefix: str = "") -> tuple[list[int], list[int]]:
        joints = [self.model.joint(prefix + name) for name in self.robot.joints]
        return [j.qposadr[0] for j in joints], [j.dofadr[0] for j in joints]

    def write(self, q, v, theta, theta_dot) -> None:
        """Set the state."""
        n = self.robot.n
        d = self.data
        if self.robot.floating_base:
            rotation = self._rotation(q)
            d.qpos[:3], d.qpos[3], d.qpos[4:7] = q[:3], q[6], q[3:6]
            d.qvel[:3], d.qvel[3:6] = rotation @ v[:3], v[3:6]
        positions, rates = self._addresses()
        d.qpos[positions], d.qvel[rates] = q[-n:], v[-n:]
        positions, rates = self._addresses("rotor_")
        d.qpos[positions], d.qvel[rates] = theta, theta_dot

    def read(self):
        """Return q, v, theta, theta_dot."""
        d = self.data
        positions, rates = self._addresses()
        q, v = d.qpos[positions].copy(), d.qvel[rates].copy()
        if self.robot.floating_base:
            base = np.concatenate([d.qpos[:3], d.qpos[4:7], d.qpos[3:4]])
            rotation = self._rotation(base)
            q = np.concatenate([base, q])
            v = np.concatenate([rotation.T @ d.qvel[:3], d.qvel[3:6], v])
        positions, rates = self._addresses("rotor_")
        return q, v, d.qpos[positions].copy(), d.qvel[rates].copy()

    def hold(self, foot: str) -> None:
        """Fix a foot where it is."""
        mujoco.mj_forward(self.model, self.data)
        place = self.data.site(foot).xpos.copy()
        self.model.site_pos[self.model.site("anchor_" + foot).id] = place
        self.data.eq_active[self.model.equality(foot).id] = 1

    def tilt_ground(self, foot: str, point, rotation) -> None:
        """Let the ground below a foot be the plane through a point, normal to the third column."""
        ground = self.model.geom("ground_" + foot).id
        self.model.geom_sameframe[ground] = 0
        self.model.geom_pos[ground] = point
        mujoco.mju_mat2Quat(self.model.geom_quat[ground], np.ascontiguousarray(rotation).ravel())

    def fill_delay(self, command) -> None:
        """Let the actuators' past be a constant command."""
        for i, value in enumerate(command):
            count = int(self.model.actuator_history[i][0])
            times = self.data.time - self.model.opt.timestep * np.arange(count, 0, -1)
            mujoco.mj_initCtrlHistory(self.model, self.data, i, times, np.full(count, value))

    @staticmethod
    def _rotation(q):
        out = np.empty(9)
        mujoco.mju_quat2Mat(out, np.array([q[6], q[3], q[4], q[5]]))
        return out.reshape(3, 3)
