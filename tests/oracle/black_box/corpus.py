"""Random designs as TOML texts: every choice a project file has, at scales that fit the robot."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from oracle.black_box.design import example_robots
from oracle.black_box.own_urdf import random_urdf

EXAMPLE = "example-robot-data:"
SMALL = (
    "asr_twodof_description/urdf/TwoDofs.urdf",
    "double_pendulum_description/urdf/double_pendulum.urdf",
    "finger_edu_description/robots/finger_edu.urdf",
)
ARMS = (
    "z1_description/urdf/z1.urdf",
    "ur_description/urdf/ur3_robot.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "kinova_description/robots/kinova.urdf",
    "panda_description/urdf/panda.urdf",
    "so_arm_description/urdf/so100.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "talos_data/robots/talos_left_arm.urdf",
)
LEGGED = (
    "bolt_description/robots/bolt.urdf",
    "solo_description/robots/solo.urdf",
    "solo_description/robots/solo12.urdf",
    "anymal_b_simple_description/robots/anymal.urdf",
    "a1_description/urdf/a1.urdf",
    "go1_description/urdf/go1.urdf",
    "quadruped_description/urdf/quadruped.urdf",
    "borinot_description/urdf/borinot_flying_arm_2.urdf",
)
LARGE = (
    "baxter_description/urdf/baxter.urdf",
    "talos_data/robots/talos_reduced.urdf",
    "tiago_description/robots/tiago.urdf",
    "simple_humanoid_description/urdf/simple_humanoid.urdf",
)
FORMS = ("symmetric", "published", "force")
FEEDBACKS = ("motor", "static_joint", "static_joint_tank", "joint")
AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheme:
    """What a random design is drawn from: shares of robots, and most joints of an own one."""

    own: float = 0.9
    small: float = 0.1
    arms: float = 0.0
    legged: float = 0.0
    large: float = 0.0
    most_joints: int = 2


SUITE = Scheme()
NIGHT = Scheme(own=0.45, small=0.1, arms=0.22, legged=0.18, large=0.05, most_joints=4)


@dataclass(slots=True, kw_only=True)
class Model:
    """A robot as the corpus needs it: names, limits, frames, and scales at a posture."""

    urdf: str
    model: pin.Model
    mimics: set[str]
    floating: bool
    joints: list[str] = field(default_factory=list)
    frames: list[str] = field(default_factory=list)
    feet: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """List joints, and the links that can be held."""
        names = [n for n in list(self.model.names)[1:] if n != "root_joint"]
        self.joints = [n for n in names if n not in self.mimics]
        taken = set(self.model.names)
        bodies = [f for f in self.model.frames if f.type == pin.FrameType.BODY]
        bodies = [f for f in bodies if f.parentJoint > 0 and f.name not in taken]
        self.frames = [f.name for f in bodies]
        parents = set(self.model.parents)
        leaves = [f for f in bodies if f.parentJoint not in parents]
        self.feet = [f.name for f in leaves]


def random_design(seed: int, folder: Path, scheme: Scheme = SUITE) -> Path:
    """Write a random project file.

    Args:
        seed: decides everything.
        folder: where the file, and its URDF if it is an own one, are written.
        scheme: shares of robots.

    Returns:
        Its path.
    """
    rng = np.random.default_rng(seed)
    model = _robot(rng, seed, folder, scheme)
    text = _Writer(rng, model).text()
    path = folder / f"design_{seed}.toml"
    path.write_text(f"# seed {seed}\n{text}")
    return path


def _robot(rng: np.random.Generator, seed: int, folder: Path, scheme: Scheme) -> Model:
    shares = np.array([scheme.own, scheme.small, scheme.arms, scheme.legged, scheme.large])
    kind = rng.choice(5, p=shares / shares.sum())
    if kind == 0:
        floating = bool(rng.random() < 0.5)
        name = f"robot_{seed}.urdf"
        text = random_urdf(rng, scheme.most_joints)
        (folder / name).write_text(text)
    else:
        name = EXAMPLE + str(rng.choice((SMALL, ARMS, LEGGED, LARGE)[kind - 1]))
        floating = bool(rng.random() < (0.9 if kind == 3 else 0.15))
        if "talos_left" in name or "baxter" in name:
            floating = False
        text = (example_robots() / name.removeprefix(EXAMPLE)).read_text()
    root = pin.JointModelFreeFlyer() if floating else None
    model = pin.buildModelFromXML(text, root) if root else pin.buildModelFromXML(text)
    mimics = _mimics(text)
    return Model(urdf=name, model=model, mimics=mimics, floating=floating)


def _mimics(text: str) -> set[str]:
    from xml.etree import ElementTree

    root = ElementTree.fromstring(text)
    return {j.get("name", "") for j in root.iterfind("joint") if j.find("mimic") is not None}


class _Writer:
    """Draws the sections of one project file."""

    def __init__(self, rng: np.random.Generator, robot: Model) -> None:
        self.rng, self.robot, self.model = rng, robot, robot.model
        self.data = robot.model.createData()
        joints = robot.joints
        self.subset = len(joints) > 3 and not robot.floating and rng.random() < 0.2
        if len(joints) > 20:
            self.subset = self.subset or rng.random() < 0.5
        if self.subset:
            count = int(rng.integers(2, min(len(joints), 14)))
            joints = sorted(rng.choice(joints, count, replace=False), key=robot.joints.index)
        self.joints = [str(j) for j in joints]
        self._pose()
        self._scales()

    def chance(self, p: float) -> bool:
        """Return True with probability p."""
        return bool(self.rng.random() < p)

    def log(self, low: float, high: float) -> float:
        """Return a number whose logarithm is uniform."""
        return float(np.exp(self.rng.uniform(math.log(low), math.log(high))))

    def _pose(self) -> None:
        """Joint positions inside their limits, now and then near a singular posture; the base."""
        self.position: dict[str, float] = {}
        straight = self.chance(0.1)
        for name in self.joints:
            joint = self.model.joints[self.model.getJointId(name)]
            low, high = -1.5, 1.5
            if joint.nq == 1:
                low = max(low, float(self.model.lowerPositionLimit[joint.idx_q]))
                high = min(high, float(self.model.upperPositionLimit[joint.idx_q]))
            sliding = "P" in joint.shortname()[10:11]
            width = 0.2 if sliding else 1.0
            value = float(np.clip(self.rng.normal(0.0, width), low, high))
            if low >= high:
                value = 0.0
            if straight:
                value = float(np.clip(self.rng.choice([-1, 1]) * self.log(1e-6, 1e-1), low, high))
            self.position[name] = value
        self.contacts: list[tuple[str, str]] = []
        self.q = self._configuration(np.eye(3), np.zeros(3))
        if not self.robot.floating:
            return
        self._choose_contacts()
        R = _rotation(self.rng)
        if self.chance(0.3):
            R = np.eye(3)
        self.q = self._configuration(R, np.zeros(3))
        R = self._balanced(R)
        self.q = self._configuration(R, self.rng.normal(size=3) * 0.3)

    def _choose_contacts(self) -> None:
        feet = self.robot.feet if self.chance(0.8) and self.robot.feet else self.robot.frames
        most = min(len(feet), 4)
        count = int(self.rng.choice(5, p=[0.08, 0.22, 0.2, 0.25, 0.25]))
        chosen = self.rng.choice(feet, min(count, most), replace=False) if most else []
        for frame in chosen:
            kind = "surface" if self.chance(0.25) else "point"
            self.contacts.append((str(frame), kind))

    def _configuration(self, R: np.ndarray, p: np.ndarray) -> np.ndarray:
        q = pin.neutral(self.model)
        if self.robot.floating:
            q[:7] = pin.SE3ToXYZQUAT(pin.SE3(R, p))
        for name, value in self.position.items():
            joint = self.model.joints[self.model.getJointId(name)]
            q[joint.idx_q] = value
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = math.cos(value), math.sin(value)
        return q

    def _balanced(self, R: np.ndarray) -> np.ndarray:
        """Turn the base so that the robot hangs below, or stands on, one or two point contacts."""
        frames = [f for f, _ in self.contacts]
        surfaces = any(kind == "surface" for _, kind in self.contacts)
        if surfaces or len(frames) not in (1, 2) or self.chance(0.15):
            return R
        points = []
        pin.framesForwardKinematics(self.model, self.data, self.q)
        for frame in frames:
            number = self.model.getFrameId(frame, pin.FrameType.BODY)
            points.append(self.data.oMf[number].translation.copy())
        arm = pin.centerOfMass(self.model, self.data, self.q) - points[0]
        down = np.array([0.0, 0.0, -1.0]) * (1.0 if self.chance(0.85) else -1.0)
        if len(points) == 1:
            return pin.Quaternion.FromTwoVectors(arm, down).toRotationMatrix() @ R
        axis = points[1] - points[0]
        length = float(np.linalg.norm(axis))
        if length < 1e-6:
            return R
        axis = axis / length
        a, b = arm - axis * (axis @ arm), down - axis * (axis @ down)
        if min(np.linalg.norm(a), np.linalg.norm(b)) < 1e-6:
            return R
        angle = math.atan2(axis @ np.cross(a, b), a @ b)
        return pin.exp3(axis * angle) @ R

    def _scales(self) -> None:
        """Inertia and gravity load of each joint at the posture."""
        M = pin.crba(self.model, self.data, self.q)
        M = np.triu(M) + np.triu(M, 1).T
        g = pin.computeGeneralizedGravity(self.model, self.data, self.q)
        at = [self.model.joints[self.model.getJointId(j)].idx_v for j in self.joints]
        largest = max(float(M[i, i]) for i in at)
        self.inertia = {j: max(float(M[i, i]), 1e-3 * largest) for j, i in zip(self.joints, at)}
        self.load = {j: abs(float(g[i])) for j, i in zip(self.joints, at)}
        self.mass = sum(body.mass for body in self.model.inertias)
        self.mean = float(np.exp(np.mean([math.log(v) for v in self.inertia.values()])))

    def text(self) -> str:
        """Return the project file."""
        self.feedback = str(self.rng.choice(FEEDBACKS, p=[0.35, 0.35, 0.15, 0.15]))
        self.spring_rate = self.log(8.0, 80.0)  # rad/s
        parts = [self._robot_section(), self._posture_section(), self._actuator_section()]
        parts += [f'[[contacts]]\nframe = "{f}"\nkind = "{k}"' for f, k in self.contacts]
        parts += [self._controller_section(), *self._task_sections(), self._delay_section()]
        return "\n".join(parts) + "\n"

    def _robot_section(self) -> str:
        base = "floating" if self.robot.floating else "fixed"
        text = f'[robot]\nurdf = "{self.robot.urdf}"\nbase = "{base}"'
        if self.subset:
            text += f"\nactuated = {_names(self.joints)}"
        return text

    def _posture_section(self) -> str:
        lines = ["[posture]"]
        if self.robot.floating:
            lines.append(f"base_position = {_numbers(self.q[:3])}")
            lines.append(f"base_quaternion_xyzw = {_numbers(self.q[3:7])}")
        lines.append("[posture.joints]")
        lines += [f'"{j}" = {float(v)!r}' for j, v in self.position.items()]
        return "\n".join(lines)

    def _actuator_section(self) -> str:
        ideal = self.chance(0.75)
        bandwidth = self.log(30.0, 3000.0)
        beta = self.log(0.2, 3.0) if self.chance(0.6) else 1.0
        sprung, viscous = self.chance(0.3), self.chance(0.15)
        zeta = self.log(0.1, 10.0)
        rubbing, limited = self.chance(0.12), self.chance(0.15)
        parts = ["[actuators]"]
        for j in self.joints:
            K = self.inertia[j] * (self.spring_rate * self.log(0.4, 2.5)) ** 2
            K = max(K, self.load[j] * self.log(1.0, 10.0), 0.01)
            B = self.inertia[j] * self.log(0.02, 2.0)
            D = zeta * math.sqrt(K * B) * self.log(0.4, 2.5)
            lines = [
                f'[actuators.joint."{j}"]',
                f"spring_stiffness = {K!r}",
                f"rotor_inertia = {max(B, 1e-8)!r}",
                f"motor_damping = {max(D, 1e-5)!r}",
                f"inertia_shaping = {beta * self.log(0.8, 1.25) if beta != 1.0 else 1.0!r}",
            ]
            if sprung:
                lines.append(f"spring_damping = {math.sqrt(K * B) * self.log(0.01, 0.3)!r}")
            if viscous:
                lines.append(f"viscous_friction = {D * self.log(0.05, 0.5)!r}")
            if not ideal and self.chance(0.8):
                lines.append(f"torque_bandwidth = {bandwidth * self.log(0.5, 2.0)!r}")
            if rubbing:
                lines.append(f"coulomb_friction = {self.load[j] * self.log(0.01, 0.5)!r}")
            if limited:
                lines.append(f"torque_limit = {max(self.load[j], 0.1) * self.log(0.7, 5.0)!r}")
            parts.append("\n".join(lines))
        return "\n".join(parts)

    def _controller_section(self) -> str:
        choose = self.rng.choice
        self.form = str(choose(FORMS, p=[0.5, 0.25, 0.25]))
        lines = [
            "[controller]",
            f'feedback = "{self.feedback}"',
            f'gravity = "{choose(["feedback", "planned", "none"], p=[0.4, 0.45, 0.15])}"',
            f'stiffness_form = "{self.form}"',
            f'task_inertia = "{choose(["lambda_ts", "lambda_star"], p=[0.7, 0.3])}"',
            f'task_error = "{choose(["consistent", "plain"], p=[0.75, 0.25])}"',
        ]
        if self.feedback == "static_joint_tank":
            lines.append(f'tank_flow = "{choose(["corrected", "published"])}"')
            rate, energy = self.log(0.5, 20.0), self.log(0.5, 10.0)
            lines.append(f"tank_rate = {0.0 if self.chance(0.1) else rate!r}")
            lines.append(f"tank_energy_j = {0.0 if self.chance(0.15) else energy!r}")
        return "\n".join(lines)

    def _task_sections(self) -> list[str]:
        count = int(self.rng.choice([1, 2, 3], p=[0.4, 0.4, 0.2]))
        tasks, priority = [], 1
        rate = self.spring_rate * self.log(0.05, 0.7)
        for k in range(count):
            last = k == count - 1
            kinds = ["com", "posture"]
            if self.robot.frames:
                kinds += ["position", "orientation", "pose"]
            kind = str(self.rng.choice(kinds))
            if last and self.chance(0.6):
                kind = "posture"
            tasks.append(self._task(f"t{k}", kind, priority, rate))
            priority += int(self.chance(0.7))
        return tasks

    def _task(self, name: str, kind: str, priority: int, rate: float) -> str:
        lines = ["[[tasks]]", f'name = "{name}"', f'kind = "{kind}"', f"priority = {priority}"]
        scale = {"com": self.mass, "position": self.mass}.get(kind, self.mean)
        rows = {"pose": 6, "posture": len(self.joints)}.get(kind, 3)
        if kind == "posture" and self.chance(0.3) and len(self.joints) > 1:
            some = int(self.rng.integers(1, len(self.joints)))
            names = [str(j) for j in self.rng.choice(self.joints, some, replace=False)]
            lines.append(f"joints = {_names(names)}")
            rows = some
        if kind in ("position", "orientation", "pose"):
            lines.append(f'frame = "{self.rng.choice(self.robot.frames)}"')
        if kind != "posture" and self.chance(0.4):
            every = [*AXES, "rx", "ry", "rz"] if kind == "pose" else list(AXES)
            some = int(self.rng.integers(1, len(every)))
            axes = sorted(self.rng.choice(len(every), some, replace=False))
            lines.append(f"axes = {_names([every[a] for a in axes])}")
            rows = some
        unit = scale if self.form == "force" else 1.0
        gain = unit * (rate * self.log(0.5, 2.0)) ** 2
        if self.chance(0.5):
            lines.append(f"stiffness = {max(gain, 1e-5)!r}")
        else:
            spread = [max(gain * self.log(0.2, 5.0), 1e-5) for _ in range(rows)]
            lines.append(f"stiffness = {_numbers(spread)}")
        return "\n".join(lines)

    def _delay_section(self) -> str:
        lines = ["[delays]", _constant("central_round_trip", self.log(0.01, 10.0))]
        if self.chance(0.12):
            lines.append(_constant("embedded_up", self.log(0.2, 20.0)))
            lines.append(_constant("embedded_down", self.log(0.01, 3.0)))
            lines.append("delayed_torque_feedback = true")
        else:
            lines.append(_constant("embedded_round_trip", self.log(0.01, 3.0)))
        return "\n".join(lines)


def _constant(key: str, value: float) -> str:
    return f'{key} = {{ kind = "constant", value_ms = {value!r} }}'


def _names(names: list[str]) -> str:
    return "[" + ", ".join(f'"{name}"' for name in names) + "]"


def _numbers(values) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def _rotation(rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=4)
    return pin.Quaternion(x / np.linalg.norm(x)).toRotationMatrix()
