"""Parts of (10), (11) and (17) that the criterion leaves out: μ, F_c and a reference x_d(q̄)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._figure4 import simulated_motion
from humanoids2016._live import LiveLeg
from humanoids2016._rotors import CoupledRotors
from humanoids2016._unsafe import delayed_margin
from humanoids2016._walk import Walk
from sealag.design import System
from sealag.passivity import Instant, Problem, solve
from sealag.typing import Array
from sealag.whole_body import GravityCompensation, MotorAngles

ROWS = 60
"""Instants of the simulated walk."""
PUSH = np.array([60.0, 0.0, 0.0, 0.0, 6.0, 0.0])
"""F_c at the task point: N, then Nm."""
X, Y, Z = range(3)  # rows of the task: CoM first, then the torso's orientation


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskTerms:
    """Sizes of the terms of (10) along the simulated walk, RMS of the CoM's rows.

    Attributes:
        feedback_n: of ΛK_x x̃ with the printed gains, against the planned CoM, N.
        mu_n: of μ, which (11) leaves out, N.
        push_n: of F_c as it was applied, in the task's own directions, N.
        residual: largest |Λ Δẍ + F_c| over |F_c|: the plant's answer to F_c against (10).
    """

    feedback_n: float
    mu_n: float
    push_n: float
    residual: float


def task_terms(system: System, walk: Walk) -> TaskTerms:
    """Compute the terms of (10), and put the plant's answer to F_c against it.

    Args:
        system: Hume with the paper's gains.
        walk: the simulated walk.
    """
    run, robot = walk.run, system.robot
    plant = CoupledRotors(robot, system.actuators, np.inf)
    law = replace(system.law, signal=MotorAngles(), gravity=GravityCompensation.NONE)
    pick = np.unique(np.linspace(0, len(run.time) - 1, ROWS).astype(int)).tolist()
    motion = simulated_motion(run)
    spaces = replace(system, law=law).spaces(motion).at(pick)
    K_x, at = np.asarray(spaces.K_x), robot.workspace()
    torso = next(task.frame for task in system.law.tasks if task.frame)
    feedback, mu, pushes, residual = [], [], [], 0.0

    def acceleration(k: int, feet: list[str], *, moving: bool, force: Array) -> Array:
        q, v = run.q[k], run.v[k] * float(moving)
        at.update(q, v)
        J = np.concatenate([at.com_jacobian(), at.frame_jacobian(torso)[3:]])
        bias = np.concatenate([at.com_bias(), at.frame_bias(torso)[3:]])
        found = plant.accelerate(
            q, v, run.theta[k], run.theta_dot[k], motor=run.tau_motor[k], feet=feet,
            load=-J.T @ force,
        )  # fmt: skip
        return J @ found.link + bias

    for row, k in enumerate(pick):
        contacts = motion.contact_sets[int(motion.contact_index[k])]
        feet, Lambda = [contact.frame for contact in contacts], spaces.Lambda[row]
        free = np.zeros(6)
        now = acceleration(k, feet, moving=True, force=free)
        still = acceleration(k, feet, moving=False, force=free)
        pushed = acceleration(k, feet, moving=True, force=PUSH)
        inside = Lambda @ np.linalg.pinv(Lambda, rcond=1e-9, hermitian=True)
        acting = inside @ PUSH
        away = Lambda @ (pushed - now) + acting
        residual = max(residual, float(np.linalg.norm(away) / np.linalg.norm(acting)))
        at.update(run.q[k], run.v[k])
        planned = walk.case.walking.gait.com_height
        error = np.zeros(6)
        ground = min(robot.link_heights(feet, run.q[k]).tolist())
        error[Z] = ground + planned - float(at.com[Z])
        feedback.append((Lambda @ K_x @ error)[:3])
        mu.append((Lambda @ (still - now))[:3])
        pushes.append(acting[:3])
    return TaskTerms(
        feedback_n=_rms(feedback), mu_n=_rms(mu), push_n=_rms(pushes), residual=residual
    )


def _rms(rows: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(rows), axis=1))))


REFERENCES: Mapping[str, Mapping[tuple[int, int], float]] = {
    "x_d(t)": {},
    "CoM height on a plane of slope 0.1": {(Z, X): 0.1},
    "CoM height on a plane of slope 0.3": {(Z, X): 0.3},
    "CoM x, y left to the pendulum": {(X, X): 1.0, (Y, Y): 1.0},
    "CoM x, y twice as far as the CoM": {(X, X): 2.0, (Y, Y): 2.0},
}
"""∂x_d/∂x by row and column: what a reference that is taken at q̄ feeds back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceRow:
    """One kind of reference, over the instants of the walk.

    Attributes:
        name: what x_d is.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖.
        least: smallest eigenvalue of F's symmetric part, Nm/rad.
        bound_s: smallest bound of (29) with the whole F, s.
        margin_s: smallest exact margin of the stance leg, its torso held, s.
        unstable: of how many instants it is unstable without delay.
        instants: of how many.
    """

    name: str
    asymmetry: float
    least: float
    bound_s: float
    margin_s: float
    unstable: int
    instants: int


def reference_rows(live: LiveLeg) -> tuple[ReferenceRow, ...]:
    """Take the reference at q̄, as (17) writes it: F = J*ᵀ S (J* − ∂x_d/∂q̄).

    Args:
        live: the stance leg along the walk.
    """
    values, V = np.linalg.eigh(live.Lambda)
    root = (V * np.sqrt(np.clip(values, 0.0, None))[:, None, :]) @ np.swapaxes(V, 1, 2)
    S, J = root @ np.diag(live.gains) @ root, live.J_star
    found = []
    for name, entries in REFERENCES.items():
        seen = np.eye(6)
        for place, slope in entries.items():
            seen[place] -= slope
        F = np.swapaxes(J, 1, 2) @ S @ seen @ J
        turned = np.swapaxes(F, 1, 2)
        bounds = solve(Problem.of_stiffness(F, live.motor_damping), share=Instant()).delay
        margins = np.array([
            delayed_margin(
                M, live.spring_stiffness, live.inertia_shaping * live.rotor_inertia,
                D=live.motor_damping, F=one,
            ).delay
            for M, one in zip(live.mass, F, strict=True)
        ])  # fmt: skip
        found.append(
            ReferenceRow(
                name=name,
                asymmetry=float(_ratio(F - turned, F + turned).max()),
                least=float(np.linalg.eigvalsh((F + turned) / 2.0)[:, 0].min()),
                bound_s=float(bounds.min()),
                margin_s=float(margins.min()),
                unstable=int((margins == 0.0).sum()),
                instants=len(margins),
            )
        )
    return tuple(found)


def _ratio(odd: Array, even: Array) -> Array:
    return np.linalg.norm(odd, axis=(1, 2)) / np.linalg.norm(even, axis=(1, 2))
