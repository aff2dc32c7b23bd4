"""The stance leg's matrices along the walk, for bounds that the reader's browser computes."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanoids2016._figure4 import ABDUCTION_DAMPING, ALPHA, LEG, stance_columns, stance_leg
from sealag.design import System
from sealag.robot import Motion, Robot
from sealag.typing import Array

LIVE_INSTANTS = 40
"""Instants of the walk that the page carries."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveLeg:
    """One leg at some instants of the walk, as the paper takes it.

    Attributes:
        time: (N,) s.
        J_star: (N, 6, 3) columns of the stance leg.
        Lambda: (N, 6, 6) task inertia.
        mass: (N, 3, 3) mass matrix of the stance leg with the torso held, kg m².
        spin: (N, 3, 3) J_ωᵀ z of the links that carry its rotors, a column for each: C = spin B/r.
        rotor_inertia: (3,) B, kg m².
        motor_damping: (3,) D_θ, Nms/rad.
        spring_stiffness: (3,) K, Nm/rad.
        gains: (6,) K_x, 1/s².
        inertia_shaping: β.
        delay: largest delay d_1 of the design, s.
    """

    time: Array
    J_star: Array
    Lambda: Array
    mass: Array
    spin: Array
    rotor_inertia: Array
    motor_damping: Array
    spring_stiffness: Array
    gains: Array
    inertia_shaping: float
    delay: float

    def markup(self) -> str:
        """Return sliders, answers and the script behind them."""
        import jinja2
        from markupsafe import Markup

        values, V = np.linalg.eigh(self.Lambda)
        root = (V * np.sqrt(np.clip(values, 0.0, None))[:, None, :]) @ np.swapaxes(V, 1, 2)
        data = {
            "time": self.time.tolist(),
            "J": self.J_star.tolist(),
            "LJ": (self.Lambda @ self.J_star).tolist(),
            "RJ": (root @ self.J_star).tolist(),
            "M": self.mass.tolist(),
            "B": self.rotor_inertia.tolist(),
            "D": self.motor_damping.tolist(),
        }
        environment = jinja2.Environment(
            loader=jinja2.PackageLoader("humanoids2016"), autoescape=True
        )
        return environment.get_template("live.html").render(
            data=Markup(json.dumps(data, separators=(",", ":"))),
            leg=self,
            last=len(self.time) - 1,
            alpha=ALPHA,
            abduction=ABDUCTION_DAMPING,
        )


def live_leg(system: System, motion: Motion) -> LiveLeg:
    """Collect the stance leg's matrices.

    Args:
        system: Hume with the paper's gains.
        motion: the planned walk.
    """
    pick = np.unique(np.linspace(0, len(motion) - 1, LIVE_INSTANTS).astype(int))
    spaces = system.spaces(motion)
    robot, drives = system.robot, system.actuators
    leg = stance_leg(robot, motion, spaces)[pick]
    own = [robot.joints.index(f"right_{part}") for part in LEG]
    return LiveLeg(
        time=motion.time[pick],
        J_star=leg,
        Lambda=spaces.Lambda[pick],
        mass=stance_masses(robot, motion, pick.tolist()),
        spin=stance_spins(robot, motion, pick.tolist()),
        rotor_inertia=drives.rotor_inertia[own],
        motor_damping=drives.motor_damping[own],
        spring_stiffness=drives.spring_stiffness[own],
        gains=np.diag(spaces.K_x).copy(),
        inertia_shaping=float(drives.shaped_inertia[own[0]] / drives.rotor_inertia[own[0]]),
        delay=system.delays.d_1,
    )


def stance_masses(robot: Robot, motion: Motion, instants: Sequence[int]) -> Array:
    """Return the mass matrix (N, 3, 3) of the stance leg with the torso held, kg m².

    Args:
        robot: Hume.
        motion: a walk; the first contact is the leg that carries more.
        instants: which of its instants.
    """
    columns, n = stance_columns(robot, motion), robot.n
    return np.array([
        robot.workspace_at(motion.q[k]).M[-n:, -n:][np.ix_(columns[k], columns[k])]
        for k in instants
    ])  # fmt: skip


def stance_spins(robot: Robot, motion: Motion, instants: Sequence[int]) -> Array:
    """Return J_ωᵀ z (N, 3, 3) of the links that carry the stance leg's rotors, torso held.

    A rotor is carried by the link before its joint and spins about the joint's axis z.

    Args:
        robot: Hume, whose legs are chains torso, abduct, thigh, shank.
        motion: a walk; the first contact is the leg that carries more.
        instants: which of its instants.
    """
    columns, found = stance_columns(robot, motion), []
    for k in instants:
        side = robot.joints[columns[k][0]].split("_")[0]
        at, own = robot.workspace_at(motion.q[k]), robot.nv_base + columns[k]
        chain = [f"{side}_{part}" for part in ("abduct", "thigh", "shank")]
        J = [at.frame_jacobian(link)[3:][:, own].copy() for link in chain]
        carriers = [np.zeros((3, 3)), *J[:-1]]
        found.append(np.column_stack([c.T @ J[i][:, i] for i, c in enumerate(carriers)]))
    return np.array(found)
