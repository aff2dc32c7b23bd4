"""The supremum at the worst instant, and the motion that reaches it, from F and D_θ alone.

(29) and (31) at d ask for d |y* F y| ≤ y* D_θ y of every motion y: no d is longer than 1/w, with
the numerical radius w = max_φ λ_max(H(φ)), H(φ) = ½ (e^{jφ} A + e^{-jφ} Aᵀ), A = D^-½ F D^-½.
"""

import math
from collections.abc import Iterator

import numpy as np

from sealag.passivity._checks import Check
from sealag.passivity._definite import Reader
from sealag.passivity._proofs import AGREEMENT, InstantProof
from sealag.passivity._stated import Stated
from sealag.typing import Array
from sealag.units import time_text

_ANGLES = 720
_POLISH = 60
"""Angles of the grid, and thirdings of a peak. Ten times fewer angles miss peaks 5° apart; with ten
times fewer thirdings the peak is known to 1 % of a step only."""


def worst_checks(c: Stated, number: Reader) -> Iterator[Check]:
    """Check limiting direction, worst motion and upper end.

    Args:
        c: the certificate.
        number: how the refutation's numbers are read: doubles or rationals.
    """
    yield _direction(c)
    upper, proof = c.answer.max_delay_upper_s, c.evidence.proof_of(c.answer.worst.instant)
    if proof is None:
        expected = 0.0 if c.answer.max_delay_s == 0.0 else math.inf
        words = "0 where a condition of the criterion fails, unbounded where F = 0"
        yield Check(name="upper end", ok=upper == expected, detail=words)
        return
    yield _refuted(c, number, proof)
    root = 1.0 / np.sqrt(c.question.D_theta)
    A = root[:, None] * proof.F * root
    yield _maximiser(c, A)
    w = _radius(A)
    yield Check(
        name="upper end is the supremum",
        ok=abs(upper * w - 1.0) <= AGREEMENT and upper >= c.answer.max_delay_s,
        detail=f"{time_text(upper)} claimed, {time_text(1.0 / w)} found, floating point",
    )


def _direction(c: Stated) -> Check:
    """Shares of the damping power y* D_θ y, which is 1."""
    real, imaginary = c.evidence.worst_motion
    power = c.question.D_theta * (real**2 + imaginary**2)
    direction = c.answer.worst.direction
    gap = np.abs(np.array(list(direction.values())) - power / power.sum()).max()
    even = abs(float(power.sum()) - 1.0)
    return Check(
        name="limiting direction",
        ok=list(direction) == list(c.question.joints) and max(gap, even) <= AGREEMENT,
        detail=f"shares of {len(direction)} joints in the worst motion's damping, to {gap:.1e}",
    )


def _refuted(c: Stated, number: Reader, proof: InstantProof) -> Check:
    """d |y* F y| ≥ y* D_θ y at the upper end, for the worst motion y."""
    upper = c.answer.max_delay_upper_s
    if upper == math.inf:
        return Check(name="upper end", ok=False, detail="unbounded, though F is not 0")
    a, b = number(c.evidence.worst_motion)
    F, D, d = number(proof.F), number(c.question.D_theta), number(upper)[()]
    power = sum(D * (a * a + b * b))
    real, imaginary = a @ F @ a + b @ F @ b, a @ F @ b - b @ F @ a
    room = number((1.0 + AGREEMENT) ** 2)[()]
    refuted = d * d * (real * real + imaginary * imaginary) * room >= power * power > 0
    words = f"the worst motion turns active by {time_text(upper)}, to {AGREEMENT:.0e}"
    return Check(name="upper end", ok=bool(refuted), detail=words)


def _maximiser(c: Stated, A: Array) -> Check:
    """The worst motion is the eigenvector of the largest eigenvalue at its own angle."""
    real, imaginary = c.evidence.worst_motion
    x = np.sqrt(c.question.D_theta) * (real + 1j * imaginary)
    angle = -float(np.angle(x.conj() @ A @ x))
    H = _hermitian(A, np.array([angle]))[0]
    size = float(np.linalg.norm(A, 2))
    rest = float(np.linalg.norm(H @ x - (x.conj() @ H @ x).real * x)) / max(size, 1e-300)
    return Check(
        name="worst motion",
        ok=rest <= math.sqrt(AGREEMENT),
        detail=f"an eigenvector at {angle:.6g} rad, to {rest:.1e}",
    )


def _hermitian(A: Array, angle: Array) -> Array:
    turned = np.exp(1j * angle)[:, None, None] * A
    return (turned + np.swapaxes(turned.conj(), 1, 2)) / 2.0


def _highest(A: Array, angle: Array) -> Array:
    return np.linalg.eigvalsh(_hermitian(A, angle))[:, -1]


def _radius(A: Array) -> float:
    """w(A): every peak of λ_max over a grid of angles, narrowed by thirds."""
    angle = np.linspace(-math.pi, math.pi, _ANGLES + 1)
    value = _highest(A, angle)
    best, step = float(value.max()), angle[1] - angle[0]
    near = angle[value >= best * math.cos(step)]
    low, high = near - step, near + step
    for _ in range(_POLISH):
        first, second = low + (high - low) / 3.0, high - (high - low) / 3.0
        rises = _highest(A, first) < _highest(A, second)
        low, high = np.where(rises, first, low), np.where(rises, high, second)
    return max(best, float(_highest(A, (low + high) / 2.0).max()))
