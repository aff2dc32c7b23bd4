"""Damping that the controller computes, moved into the drives (docs/theory section 16.6)."""

from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import InputError
from sealag.robot import Motion
from sealag.tune._answer import Tuned
from sealag.tune._findings import Replaced
from sealag.tune._gains import rounded
from sealag.tune._numbers import number_of
from sealag.tune._question import Number, Question
from sealag.typing import Array
from sealag.whole_body import GravityCompensation, Law, StiffnessForm, Task, TaskKind

_PARTS = {"central": 0.0, "half": 0.5, "embedded": 1.0}
"""Shares of the damping that move into the drives, for the comparison of jitter margins."""

_EVEN = 1e-9
"""Weight of the distance to diag C. Ten times more shows in the seventh digit of damping that could
be replaced exactly; ten times less does so by rounding, where it alone decides."""


def mapped(question: Question) -> Tuned:
    """Return the design whose drives have the damping nearest to that of its controller.

    min Σ_t ‖Π_tᵀ D Π_t − J*ᵀ D_x J*‖² over diagonal D ≥ 0, a non-negative least squares problem; Π
    are the joint motions that the contacts leave, I for a fixed base, where D is the mean of the
    diagonal.

    Args:
        question: whose design and motion.
    """
    system, motion = question.system, question.motion
    central, Pi = _central(system, motion), _consistent(system, motion)
    # Six digits: more are the rounding of joints that contacts move alike.
    fit = np.array([float(f"{value:.6g}") for value in _nearest(central, Pi)])
    left = np.linalg.norm(Pi.transpose(0, 2, 1) @ (fit[:, None] * Pi) - central, axis=(1, 2))
    size = np.linalg.norm(central, axis=(1, 2))
    scale = float(np.sqrt(np.mean(size**2)))
    if not scale > 0.0:
        raise InputError(
            f"The damping of {system.law.damped} moves no joint along the contacts; nothing is "
            "there that drives could take over."
        )
    jitter = replace(question, number=Number.JITTER)
    margins = {
        name: number_of(jitter, _moved(system, fit, share))[0] for name, share in _PARTS.items()
    }
    mapping = Replaced(
        damping=fit,
        error=float(np.sqrt(np.mean(left**2))) / scale,
        worst=float(left.max()) / scale,
        instant=int(left.argmax()),
        jitter_s=margins,
    )
    return replace(Tuned.of(question, _moved(system, fit, 1.0)), mapping=mapping)


def _central(system: System, motion: Motion | None) -> Array:
    """J*ᵀ D_x J* of each instant, (N, n, n) Nms/rad."""
    J_star = system.spaces(motion).J_star
    return J_star.transpose(0, 2, 1) @ system.law.drag(system.robot) @ J_star


def _consistent(system: System, motion: Motion | None) -> Array:
    """Π (N, n, n): what the contacts leave of joint rates, J* of a task that holds all joints."""
    joints = Task(name="joints", kind=TaskKind.POSTURE, stiffness=np.ones(system.robot.n))
    law = Law(
        tasks=(joints,),
        gravity=GravityCompensation.PLANNED,
        stiffness_form=StiffnessForm.FORCE,
    )
    return replace(system, law=law).spaces(motion).J_star


def _nearest(central: Array, Pi: Array) -> Array:
    """D ≥ 0 (n,) with the least Σ ‖Σ_i D_i π_i π_iᵀ − C‖², π_i the rows of Π."""
    from scipy.optimize import nnls

    gram = np.einsum("tik,tjk->tij", Pi, Pi)
    normal = np.sum(gram**2, axis=0)
    seen = np.einsum("tik,tkl,til->i", Pi, central, Pi)
    # Joints that contacts move alike share a sum; of all answers the one nearest to diag C.
    even = _EVEN * float(np.trace(normal))
    normal += even * np.eye(len(normal))
    seen += even * np.einsum("tii->i", central) / len(central)
    root = np.linalg.cholesky(normal).T
    return nnls(root, np.linalg.solve(root.T, seen))[0]


def _moved(system: System, fit: Array, share: float) -> System:
    """The design with a share of its controller's damping in the drives."""
    tasks = tuple(
        replace(task, damping=(1.0 - share) * np.asarray(task.damping, dtype=float))
        for task in system.law.tasks
    )
    drives = system.actuators
    drives = replace(drives, motor_damping=drives.motor_damping + share * fit)
    moved = replace(system, law=replace(system.law, tasks=tasks), actuators=drives)
    return rounded(moved, up=True)
