"""A design that sealag has exported, run in MuJoCo with late sensors and late motors."""

import re
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np

from sealag.design import System
from sealag.export import MujocoModel
from sealag.whole_body import Measurement

_LATE = re.compile(r' (?:delay|nsample|interp)="[^"]*"')


def without_delays(text: str) -> str:
    """Return an MJCF text without the attributes of its delays."""
    return _LATE.sub("", text)


@dataclass
class Exported:
    """The model in MuJoCo, and its twin whose sensors are not late."""

    system: System
    file: MujocoModel
    model: mujoco.MjModel
    data: mujoco.MjData
    prompt: mujoco.MjModel

    @classmethod
    def of(cls, system: System, file: MujocoModel, *, text: str | None = None) -> Self:
        """Compile a file, or another text in its place."""
        text = file.text if text is None else text
        model = mujoco.MjModel.from_xml_string(text)
        prompt = mujoco.MjModel.from_xml_string(without_delays(text))
        return cls(system, file, model, mujoco.MjData(model), prompt)

    def start(self, *, moved=0.0, rotors=0.0):
        """Begin at the keyframe, joints and rotors moved by angles; return what sensors see."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        n = self.system.robot.n
        self.data.qpos[-2 * n : -n] += moved
        self.data.qpos[-n:] += rotors
        seen = mujoco.MjData(self.prompt)
        seen.qpos[:], seen.qvel[:] = self.data.qpos, self.data.qvel
        mujoco.mj_forward(self.prompt, seen)
        return seen.sensordata.copy()

    def fill(self, seen, command):
        """Let the past be a constant measurement and a constant command."""
        for i, value in enumerate(command):
            if count := int(self.model.actuator_history[i][0]):
                past = np.full(count, value)
                mujoco.mj_initCtrlHistory(self.model, self.data, i, None, past)
        for i in range(self.model.nsensor):
            if count := int(self.model.sensor_history[i][0]):
                first, size = self.model.sensor_adr[i], self.model.sensor_dim[i]
                past = np.tile(seen[first : first + size], (count, 1))
                mujoco.mj_initSensorHistory(self.model, self.data, i, None, past, 0.0)

    def measured(self, seen, time) -> Measurement:
        """Return the sensors' values in sealag's order."""
        robot, drives = self.system.robot, self.system.actuators
        row = Measurement.allocate(
            nq=robot.nq, nv=robot.nv, n=robot.n, contacts=len(self.system.contacts)
        )
        row.data[0] = time
        if robot.floating_base:
            place, (w, x, y, z), velocity = seen[:3], seen[3:7], seen[7:13]
            row.q[:7], row.v[:6] = [*place, x, y, z, w], velocity
        joints, rates, theta, theta_dot = seen[-4 * robot.n :].reshape(4, -1)
        row.q_joint[:], row.v_joint[:] = joints, rates
        row.theta[:], row.theta_dot[:] = theta, theta_dot
        row.tau_sea[:] = drives.spring_stiffness * (theta - joints)
        row.tau_sea[:] += drives.spring_damping * (theta_dot - rates)
        row.contact[:] = 1.0
        return row

    def run(self, controller, duration, *, moved=0.0, rotors=0.0):
        """Run a controller; return positions (steps, nq in MuJoCo's order)."""
        seen = self.start(moved=moved, rotors=rotors)
        command, steps = np.zeros(self.model.nu), self.file.steps
        first = self.measured(seen, 0.0)
        controller.reset(0.0, first)
        controller.tick(0.0, first, command)
        self.fill(seen, command)
        controller.reset(0.0, first)
        places = []
        for k in range(round(duration / steps.step)):
            mujoco.mj_step1(self.model, self.data)
            places.append(self.data.qpos.copy())
            if k % steps.tick == 0:
                t = k * steps.step
                then = max(t - steps.measurement_delay, 0.0)
                controller.tick(t, self.measured(self.data.sensordata, then), command)
                self.data.ctrl[:] = command
            mujoco.mj_step2(self.model, self.data)
        return np.array(places)
