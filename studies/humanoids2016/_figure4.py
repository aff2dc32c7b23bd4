"""Fig. 4: the largest delay of Theorem 1 along the 7-step walk, against damping."""

from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._claims import Claim, Verdict
from humanoids2016._random_table import RandomPlantTable
from sealag.design import System
from sealag.passivity import max_delay
from sealag.robot import Contact, Motion, Robot
from sealag.simulation import Run
from sealag.typing import Array, BoolArray, IntArray
from sealag.whole_body import (
    GravityCompensation,
    MotorAngles,
    Signal,
    Spaces,
    StaticJoint,
    StiffnessForm,
    Tank,
)

LEG = ("abduction", "hip", "knee")

VARIANTS = (
    (StiffnessForm.PUBLISHED, StaticJoint(), GravityCompensation.FEEDBACK),
    (StiffnessForm.SYMMETRIC, StaticJoint(), GravityCompensation.PLANNED),
    (StiffnessForm.SYMMETRIC, Tank(), GravityCompensation.PLANNED),
    (StiffnessForm.SYMMETRIC, MotorAngles(), GravityCompensation.PLANNED),
    (StiffnessForm.SYMMETRIC, MotorAngles(), GravityCompensation.FEEDBACK),
)
"""Ways to run the paper's gains; the first is the law as printed, Eqs. (11), (16), (17)."""

ALPHA = np.linspace(0.25, 5.0, 20)
"""Factor on the whole of D_θ, the abscissa of Fig. 4."""

ABDUCTION_DAMPING = (5.0, 10.0, 20.0)
"""D_θ[0] in Nms/rad; the paper's simulations use 10, the other two are chosen here."""

STIFFNESS_SCALE = (0.5, 1.0, 2.0)
"""Factors on K_x with which the statement about task stiffness is checked."""

INVERSE = 1e-5
"""How far delay times K_x may change for the two to count as inversely proportional."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedVariant:
    """What the certified criterion says of one way to run the same gains.

    Attributes:
        signal: the word of the signal that is fed back.
        form: how the stiffness is built from K_x and Λ.
        gravity: how gravity is compensated.
        delay_s: (N,) bound at every instant for the paper's D_θ; 0 where a condition fails.
        contraction: largest contraction factor of q̄(θ) over the walk.
        asymmetry: largest relative asymmetry of the stiffness over the walk.
        reason: why it is not certified, or an empty text.
    """

    signal: str
    form: StiffnessForm
    gravity: GravityCompensation
    delay_s: Array
    contraction: float
    asymmetry: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure4:
    """The computed Fig. 4.

    Attributes:
        time: (N,) s, the instants of the walk.
        both_feet: (N,) whether two feet stand.
        alpha: (A,) factors on D_θ.
        abduction_damping: (3,) values of D_θ[0], Nms/rad.
        delay_s: (3, A) smallest bound of (29) over the walk, with the paper's one-leg matrices:
            the stance leg's three columns of J*.
        both_legs_delay_s: (3, A) the same with all six columns.
        instants_delay_s: (3, N) bound at every instant for α = 1.
        worst_instant: (3,) index of the smallest one.
        stiffness_scale: (S,) factors on K_x.
        stiffness_delay_s: (S,) smallest bound for α = 1 and the paper's D_θ[0].
        certified: the certified criterion's answers for the same gains.
    """

    time: Array
    both_feet: BoolArray
    alpha: Array
    abduction_damping: Array
    delay_s: Array
    both_legs_delay_s: Array
    instants_delay_s: Array
    worst_instant: Array
    stiffness_scale: Array
    stiffness_delay_s: Array
    certified: tuple[CertifiedVariant, ...]


def figure_4(system: System, motion: Motion) -> Figure4:
    """Compute Fig. 4 over every instant of a walk.

    Args:
        system: Hume with the paper's gains.
        motion: the planned (or simulated) walk; the first contact is the leg that carries more.

    Returns:
        Bounds of the published criterion over α and D_θ[0], and of the certified one.
    """
    robot = system.robot
    printed = replace(
        system,
        law=replace(
            system.law,
            stiffness_form=StiffnessForm.PUBLISHED,
            signal=MotorAngles(),
            gravity=GravityCompensation.NONE,
        ),
    )
    spaces = printed.spaces(motion)
    leg = stance_leg(robot, motion, spaces)
    D = system.actuators.motor_damping
    hip = [robot.joints.index(f"right_{name}") for name in LEG]
    one_leg = D[hip]
    alpha, first = ALPHA, np.array(ABDUCTION_DAMPING)
    worst, both, instants = np.zeros((3, len(alpha))), np.zeros((3, len(alpha))), []
    for i, damping in enumerate(first):
        leg_D = np.array([damping, *one_leg[1:]])
        body_D = np.array(
            [damping if "abduction" in j else D[k] for k, j in enumerate(robot.joints)]
        )
        for k, factor in enumerate(alpha):
            bound = max_delay(leg, spaces.Lambda, spaces.K_x, factor * leg_D, form="published")
            whole = max_delay(
                spaces.J_star, spaces.Lambda, spaces.K_x, factor * body_D, form="published"
            )
            worst[i, k], both[i, k] = bound.delay.min(), whole.delay.min()
        instants.append(max_delay(leg, spaces.Lambda, spaces.K_x, leg_D, form="published").delay)
    scaled = [
        float(max_delay(leg, spaces.Lambda, s * spaces.K_x, one_leg, form="published").delay.min())
        for s in STIFFNESS_SCALE
    ]
    return Figure4(
        time=motion.time,
        both_feet=np.array([len(feet) > 1 for feet in motion.contact_sets])[motion.contact_index],
        alpha=alpha,
        abduction_damping=first,
        delay_s=worst,
        both_legs_delay_s=both,
        instants_delay_s=np.array(instants),
        worst_instant=np.argmin(np.array(instants), axis=1),
        stiffness_scale=np.array(STIFFNESS_SCALE),
        stiffness_delay_s=np.array(scaled),
        certified=tuple(_certified(system, motion, *variant) for variant in VARIANTS),
    )


def stance_leg(robot: Robot, motion: Motion, spaces: Spaces) -> Array:
    """Return the stance leg's three columns of J* at each instant: (N, m, 3).

    Args:
        robot: Hume.
        motion: a walk; the first contact is the leg that carries more.
        spaces: the law's matrices along it.
    """
    columns = stance_columns(robot, motion)
    return np.take_along_axis(spaces.J_star, columns[:, None, :], axis=2)


def stance_columns(robot: Robot, motion: Motion) -> IntArray:
    """Return the joints of the stance leg at each instant, (N, 3) indices.

    Args:
        robot: Hume.
        motion: a walk; the first contact is the leg that carries more.
    """
    sides = [contacts[0].frame.removesuffix("_foot") for contacts in motion.contact_sets]
    each = np.array([[robot.joints.index(f"{side}_{name}") for name in LEG] for side in sides])
    return each[motion.contact_index]


def _certified(
    system: System,
    motion: Motion,
    form: StiffnessForm,
    signal: Signal,
    gravity: GravityCompensation,
) -> CertifiedVariant:
    """The certified criterion for one way to run the gains, all six joints."""
    law = replace(system.law, stiffness_form=form, signal=signal, gravity=gravity)
    design = replace(system, law=law)
    spaces = design.spaces(motion)
    bounds = design.certified_bounds(spaces)
    return CertifiedVariant(
        signal=signal.name,
        form=form,
        gravity=gravity,
        delay_s=bounds.delay,
        contraction=float(spaces.contraction.max()),
        asymmetry=float(np.nanmax(spaces.asymmetry)),
        reason="; ".join(bounds.refusals),
    )


def figure_4_claims(figure: Figure4, table: RandomPlantTable) -> tuple[Claim, ...]:
    """Check what the paper says about Fig. 4 and Theorem 1.

    Args:
        figure: the computed figure.
        table: both criteria against exact margins.
    """
    low, high = figure.delay_s[:, 0] * 1e3, figure.delay_s[:, -1] * 1e3
    ratio = figure.delay_s / figure.delay_s[:, :1] / (figure.alpha / figure.alpha[0])
    middle = int(np.argmin(np.abs(figure.alpha - 1.0)))
    by_damping = figure.delay_s[:, middle] * 1e3
    product = figure.stiffness_delay_s * figure.stiffness_scale
    inverse = np.abs(product / product[0] - 1.0)[1:] < INVERSE
    bounds = ", ".join(f"{d * 1e3:.1f}" for d in figure.stiffness_delay_s)
    refused = [
        f"{v.form}, {v.signal}, gravity {v.gravity}".replace("_", " ")
        for v in figure.certified
        if v.reason
    ]
    return (
        Claim(
            key="alpha",
            source="Section V, Fig. 4",
            published="A larger factor α on the motor damping D_θ allows a larger delay.",
            computed=(
                f"From α = {figure.alpha[0]:g} to {figure.alpha[-1]:g} the smallest bound over the "
                f"walk rises from {low[1]:.1f} to {high[1]:.1f} ms at D_θ[0] = "
                f"{figure.abduction_damping[1]:g} Nms/rad; it is proportional to α to "
                f"{np.abs(ratio - 1.0).max():.1e}. Proof: with αD_θ the matrix in w is divided by "
                "α, and w is a norm."
            ),
            verdict=Verdict.theorem(np.abs(ratio - 1.0).ravel() < INVERSE),
            tolerance=f"a theorem; computed values in proportion to {INVERSE:g}",
        ),
        Claim(
            key="abduction",
            source="Section V, Fig. 4",
            published="A larger damping D_θ[0] of the abduction joint allows a larger delay.",
            computed=(
                "At α = 1 the bounds for D_θ[0] = "
                + ", ".join(f"{d:g}" for d in figure.abduction_damping)
                + " Nms/rad are "
                + ", ".join(f"{d:.1f}" for d in by_damping)
                + " ms."
            ),
            verdict=Verdict.of((np.diff(figure.delay_s, axis=0) > 0.0).ravel()),
            tolerance="strictly increasing at every α",
        ),
        Claim(
            key="stiffness",
            source="Section V",
            published="A larger task stiffness K_x needs larger D_θ or a smaller delay.",
            computed=(
                "With K_x times "
                + ", ".join(f"{s:g}" for s in figure.stiffness_scale)
                + f" the bounds are {bounds} ms: delay times stiffness stays constant to "
                f"{np.ptp(product) / product.mean():.1e}. Proof: the matrix in w is proportional "
                "to K_x, and w is a norm."
            ),
            verdict=Verdict.theorem(inverse),
            tolerance=f"a theorem; computed values in inverse proportion to {INVERSE:g}",
        ),
        Claim(
            key="sufficient",
            source="Section IV, Theorem 1",
            published="The inequality (29) is sufficient for the passivity of the delayed loop.",
            computed=(
                f"On {table.published_longer} of {table.presupposed} random plants under the "
                "paper's law (29) allows a delay at which the exact loop is unstable, the "
                f"certified criterion on {table.certified_longer} of all {table.plants}. Of "
                f"{len(figure.certified)} ways to run the same gains "
                f"on Hume it refuses {len(refused)}: {'; '.join(refused)}."
            ),
            verdict=_sufficient(table),
            tolerance="an exact delay margin below the published bound counts against it; "
            "qualified if none lies below the certified bound",
        ),
    )


def _sufficient(table: RandomPlantTable) -> Verdict:
    """Whether (29) is sufficient as printed, or only under the certified criterion's conditions."""
    if table.published_longer == 0:
        return Verdict.CONFIRMED
    return Verdict.QUALIFIED if table.certified_longer == 0 else Verdict.CONTRADICTED


def simulated_motion(run: Run) -> Motion:
    """Turn a simulated biped walk into a motion with the feet that carry it at each instant.

    Both feet stand where both carry; the first of a set is the one that carries more. In flight
    the last ones stay.

    Args:
        run: the simulated walk.
    """
    frames = tuple(dict.fromkeys(run.feet))
    load = np.array(
        [run.contact_force[:, np.array(run.feet) == frame, 2].sum(axis=1) for frame in frames]
    )
    sets: dict[tuple[str, ...], int] = {}
    index = np.zeros(len(run.time), dtype=np.int64)
    for k, forces in enumerate(load.T):
        order = np.argsort(-forces, kind="stable")
        standing = tuple(frames[foot] for foot in order if forces[foot] > 0.0)
        if not standing:
            index[k] = index[k - 1] if k else sets.setdefault(frames, len(sets))
            continue
        index[k] = sets.setdefault(standing, len(sets))
    return Motion(
        time=run.time,
        q=run.q,
        v=run.v,
        contact_sets=tuple(tuple(Contact(frame=frame) for frame in feet) for feet in sets),
        contact_index=index,
    )
