"""Fig. 4: the largest delay of Theorem 1 along the 7-step walk, against damping."""

from dataclasses import dataclass

import numpy as np

from sealag.passivity import max_delay, max_delay_from_stiffness
from sealag.robot import Motion, Robot
from sealag.typing import Array
from sealag.whole_body import (
    Feedback,
    GravityCompensation,
    Hierarchy,
    StiffnessForm,
    WholeBodyStack,
    evaluate,
)

ALPHA = np.linspace(0.25, 5.0, 20)
"""Factor on the whole of D_θ, the abscissa of Fig. 4."""

ABDUCTION_DAMPING = (5.0, 10.0, 20.0)
"""D_θ[0] in Nms/rad; the paper's simulations use 10, the other two are chosen here."""

STIFFNESS_SCALE = (0.5, 1.0, 2.0)
"""Factors on K_x with which the statement about task stiffness is checked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedVariant:
    """What the certified criterion says of one way to run the same gains.

    Attributes:
        feedback: the signal that is fed back.
        form: how the stiffness is built from K_x and Λ.
        gravity: how gravity is compensated.
        delay_s: (N,) bound at every instant for the paper's D_θ; 0 where a condition fails.
        contraction: largest contraction factor of q̄(θ) over the walk.
        asymmetry: largest relative asymmetry of the stiffness over the walk.
        reason: why it is not certified, or an empty text.
    """

    feedback: Feedback
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
    alpha: Array
    abduction_damping: Array
    delay_s: Array
    both_legs_delay_s: Array
    instants_delay_s: Array
    worst_instant: Array
    stiffness_scale: Array
    stiffness_delay_s: Array
    certified: tuple[CertifiedVariant, ...]
