"""The supremum at the worst instant, and the motion that reaches it, from F and D_θ alone.

(29) and (31) at d ask for d |y* F y| ≤ y* D_θ y of every motion y: no d is longer than 1/w, with
the numerical radius w = max_φ λ_max(H(φ)), H(φ) = ½ (e^{jφ} A + e^{-jφ} Aᵀ), A = D^-½ F D^-½.
"""

import math
from collections.abc import Iterator

import numpy as np

from sealag.passivity._certificate import Certificate, Proof
from sealag.passivity._checks import Check
from sealag.passivity._definite import Reader
from sealag.passivity._inequalities import AGREEMENT
from sealag.typing import Array

_ANGLES = 720
_POLISH = 60


def worst_checks(c: Certificate, number: Reader, proof: Proof | None) -> Iterator[Check]:
    """Check limiting direction, worst motion and upper end.

    Args:
        c: the certificate.
        number: how the refutation's numbers are read: doubles or rationals.
        proof: of the worst instant, if there is one.
    """
    yield _direction(c)
    if proof is None:
        expected = 0.0 if c.max_delay_s == 0.0 else math.inf
        words = "0 where a condition fails, unbounded where nothing is fed back"
        yield Check(name="upper end", ok=c.max_delay_upper_s == expected, detail=words)
        return
    yield _refuted(c, number, proof)
    A = _scaled(c, proof)
    yield _maximiser(c, A)
    w = _radius(A)
    gap = abs(c.max_delay_upper_s * w - 1.0)
    words = f"{c.max_delay_upper_s:.12g} s claimed, {1.0 / w:.12g} s found, floating point"
    good = gap <= AGREEMENT and c.max_delay_upper_s >= c.max_delay_s
    yield Check(name="upper end is the supremum", ok=good, detail=words)


def _scaled(c: Certificate, proof: Proof) -> Array:
    root = 1.0 / np.sqrt(np.array(c.D_theta))
    return root[:, None] * np.array(proof.F) * root


def _direction(c: Certificate) -> Check:
    """Shares of the damping power y* D_θ y, which is 1."""
    real, imaginary = np.array(c.worst_motion)
    power = np.array(c.D_theta) * (real**2 + imaginary**2)
    gap = np.abs(np.array(list(c.worst.direction.values())) - power / power.sum()).max()
    even = abs(float(power.sum()) - 1.0)
    return Check(
        name="limiting direction",
        ok=list(c.worst.direction) == list(c.joints) and max(gap, even) <= AGREEMENT,
        detail=f"shares of {len(c.joints)} joints in the worst motion's damping, to {gap:.1e}",
    )


def _refuted(c: Certificate, number: Reader, proof: Proof) -> Check:
    """d |y* F y| ≥ y* D_θ y at the upper end, for the worst motion y."""
    a, b = number(c.worst_motion)
    upper = c.max_delay_upper_s
    if upper == math.inf:
        return Check(name="upper end", ok=False, detail="unbounded, though something is fed back")
    F, D, d = number(proof.F), number(c.D_theta), number([upper])[0]
    power = sum(D * (a * a + b * b))
    real, imaginary = a @ F @ a + b @ F @ b, a @ F @ b - b @ F @ a
    room = number([(1.0 + AGREEMENT) ** 2])[0]
    refuted = d * d * (real * real + imaginary * imaginary) * room >= power * power > 0
    words = f"the worst motion turns active by {upper:.9g} s, to {AGREEMENT:.0e}"
    return Check(name="upper end", ok=bool(refuted), detail=words)


def _maximiser(c: Certificate, A: Array) -> Check:
    """The worst motion is the eigenvector of the largest eigenvalue at its own angle."""
    real, imaginary = np.array(c.worst_motion)
    x = np.sqrt(np.array(c.D_theta)) * (real + 1j * imaginary)
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
