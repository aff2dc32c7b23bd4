"""Sensor noise and model errors of a walk."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import RobotError
from sealag.robot import Robot, load_robot
from sealag.typing import Array
from sealag.whole_body import Measurement, TickController


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorNoise:
    """Errors of ordinary encoders and an ordinary IMU; standard deviations of Gaussian errors.

    White errors are drawn anew for every tick, biases once for a run.

    Attributes:
        position: White, of joint and motor angles, rad.
        speed: White, of joint and motor speeds, rad/s.
        tilt: White, of the IMU's orientation about each axis, rad.
        tilt_bias: Of roll and pitch, rad.
        gyro: White, of the angular velocity, rad/s.
        gyro_bias: Of the angular velocity, rad/s.
    """

    position: float = 2e-4
    speed: float = 0.02
    tilt: float = 2e-3
    tilt_bias: float = 3e-3
    gyro: float = 0.01
    gyro_bias: float = 5e-3


class NoisySensors:
    """A controller that sees its robot through noisy sensors, and its base only through an IMU.

    The base's position and linear velocity are withheld (0); a controller must find them by leg
    odometry.

    Args:
        controller: The controller behind the sensors.
        robot: The robot.
        noise: How much.
        seed: Of the errors.
    """

    def __init__(
        self, controller: TickController, robot: Robot, *, noise: SensorNoise, seed: int
    ) -> None:
        self._controller, self._robot, self._noise = controller, robot, noise
        self._rng = np.random.default_rng(seed)
        self._seen = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=2)
        self._tilt = noise.tilt_bias * self._rng.standard_normal(3) * (1.0, 1.0, 0.0)
        self._spin = noise.gyro_bias * self._rng.standard_normal(3)

    def reset(self, t: float, measurement: Measurement) -> None:
        """Begin; the state at the start is known.

        Args:
            t: First instant, s.
            measurement: The state then.
        """
        self._controller.reset(t, measurement)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Let the controller compute its command from a noisy measurement.

        Args:
            t: The controller's clock, s.
            measurement: What the sensors would say without errors.
            out: Where the command (n,) is written, Nm.
        """
        seen, noise, n = self._seen, self._noise, self._robot.n
        draw = self._rng.standard_normal
        seen.data[:] = measurement.data
        turn = np.zeros(self._robot.nv)
        turn[3:6] = self._tilt + noise.tilt * draw(3)
        seen.q[:] = self._robot.integrate(measurement.q, turn)
        seen.q[:3], seen.v[:3] = 0.0, 0.0
        seen.v[3:6] += self._spin + noise.gyro * draw(3)
        seen.q[-n:] += noise.position * draw(n)
        seen.v[-n:] += noise.speed * draw(n)
        seen.theta[:] += noise.position * draw(n)
        seen.theta_dot[:] += noise.speed * draw(n)
        self._controller.tick(t, seen, out)


def wrong_robot(robot: Robot, *, error: float, seed: int) -> Robot:
    """Return a robot whose masses, centres of mass and inertias are off by a random share.

    Args:
        robot: The right one.
        error: Largest relative error; each number's is uniform in ±.
        seed: Of the errors.

    Raises:
        RobotError: The robot was not read from a file.
    """
    if robot.urdf_path is None:
        raise RobotError(f"{robot.name} is of no URDF, whose numbers could be changed.")
    rng = np.random.default_rng(seed)
    tree = ElementTree.parse(robot.urdf_path)
    for inertial in tree.iter("inertial"):
        mass, inertia, origin = (inertial.find(tag) for tag in ("mass", "inertia", "origin"))
        scale = 1.0 + error * rng.uniform(-1.0, 1.0, 3)
        if mass is not None:
            mass.set("value", repr(float(mass.get("value", "0")) * float(scale[0])))
        if inertia is not None:
            for key, value in inertia.attrib.items():
                inertia.set(key, repr(float(value) * float(scale[1])))
        if origin is not None:
            place = np.array(origin.get("xyz", "0 0 0").split(), dtype=float) * scale[2]
            origin.set("xyz", " ".join(map(repr, place.tolist())))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "wrong.urdf"
        tree.write(path)
        return load_robot(path, floating_base=robot.floating_base, actuated=robot.joints)


def wrong_springs(actuators: Actuators, *, error: float, seed: int) -> Actuators:
    """Return actuators whose springs are off by a random share.

    Args:
        actuators: The right ones.
        error: Largest relative error; each spring's is uniform in ±.
        seed: Of the errors.
    """
    share = 1.0 + error * np.random.default_rng(seed).uniform(-1.0, 1.0, actuators.n)
    return replace(actuators, spring_stiffness=actuators.spring_stiffness * share)
