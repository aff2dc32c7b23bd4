"""What gains around an answer tolerate."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import InputError
from sealag.tune._joint_pd import joint_inertia, pd_design
from sealag.tune._numbers import number_of
from sealag.tune._question import Aim, Question
from sealag.typing import Array


def number_along(question: Question, system: System, shares: Sequence[float]) -> Array:
    """Return the question's number of a design's gains times each share, (N,) s; NaN if not known.

    Args:
        question: which number, along which motion; its aim says which gains.
        system: the design.
        shares: positive factors.

    Raises:
        InputError: the aim is shaping, of which no delay depends.
    """
    design = _gains(question, system)
    found = [number_of(question, design(share))[0] for share in shares]
    return np.array([np.nan if value is None else value for value in found])


def _gains(question: Question, system: System) -> Callable[[float], System]:
    """The design with a share of what was asked for."""
    law, drives = system.law, system.actuators
    match question.aim:
        case Aim.SHAPING:
            raise InputError("No delay depends on the inertia shaping; leave --plot out.")
        case Aim.DAMPING | Aim.DRAG:
            return lambda share: replace(
                system, actuators=replace(drives, motor_damping=share * drives.motor_damping)
            )
        case Aim.BANDWIDTH:
            inertia = joint_inertia(system, question.motion)
            kp = np.asarray(law.tasks[0].stiffness)
            bandwidth = float(np.sqrt(np.max(kp / inertia)))
            ratio = question.damping_ratio
            return lambda share: pd_design(question.system, inertia, share * bandwidth, ratio)
    tasks = law.tasks

    def stiffer(share: float) -> System:
        scaled = tuple(replace(one, stiffness=share * np.asarray(one.stiffness)) for one in tasks)
        return replace(system, law=replace(law, tasks=scaled))

    return stiffer
