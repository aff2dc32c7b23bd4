"""Two ways to see a crossing: a turn φ of the delay factor, or a frequency ω, as the parameter.

A root jω of delay d has z = e^{-jφ}, φ = ωd. With one delay, λ is an eigenvalue of A_0 +
e^{-jφ} A_1 and φ runs over half a turn. With an embedded delay that is no eigenvalue problem; there
ω runs, and w = z_0/(z − z_0) is an eigenvalue of z_0 G(jω),
G = C (jω − A_0 − z_0 A_1 − A_e e^{-jωe})⁻¹ B.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sealag.margin._family import WHOLE, Family, Window
from sealag.margin._loop import EPS, Loop
from sealag.typing import Array

_BLURRED = 1e-6
"""Share of a matrix that its eigenvectors may leave. Robots leave 1e-12; double eigenvalues 1."""

_BESIDE = 1e-10
"""Share by which another matrix differs, whose double eigenvalues are 1e-5 apart: what its
eigenvectors leave, 1e-5, is then as much as they turn a hundred thousand times faster."""


class Picture(Protocol):
    """What the search asks of a parameter t."""

    @property
    def loop(self) -> Loop:
        """The loop that is looked at."""
        ...

    @property
    def edges(self) -> list[float]:
        """Where the search begins; all t are between the first and the last."""
        ...

    def family(self, t: float) -> Family | None:
        """Eigenvalues about t; None where no basis of eigenvectors can be used."""
        ...

    def window(self, lower: float, upper: float) -> Window:
        """The part of the axis that counts for t between the two."""
        ...

    def symmetric(self, t: float) -> bool:
        """Whether what lies beyond an end t mirrors what lies before it."""
        ...

    def place(self, t: float, value: complex) -> tuple[float, float]:
        """Turn φ and frequency ω of an eigenvalue on the axis at t."""
        ...

    def value(self, phi: float, omega: float) -> complex:
        """The eigenvalue on the axis of a turn and a frequency."""
        ...

    def parameter(self, phi: float, omega: float) -> float:
        """The parameter t of a turn and a frequency."""
        ...

    def width(self, t: float) -> float:
        """Length of an interval at t that is not worth splitting."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """λ over φ, for one delay.

    Attributes:
        loop: the loop.
        at_most: longest delay that counts, s; inf for all.
    """

    loop: Loop
    at_most: float

    @property
    def edges(self) -> list[float]:
        """From no turn to half a turn, or to where the fastest possible root has turned."""
        last = min(math.pi, 1.01 * self.at_most * self.loop.size)
        if last < math.pi:
            return [0.0, last]
        return [0.0, math.pi / 8.0, 7.0 * math.pi / 8.0, math.pi]

    def family(self, t: float) -> Family | None:
        """Eigenvalues of A_0 + e^{-jφ} A_1 about φ = t."""
        loop = self.loop
        z = 1.0 if t == 0.0 else -1.0 if t == math.pi else np.exp(-1j * t)
        A = loop.A_0 + z * loop.A_1
        basis = _eigenbasis(A)
        if basis is None:
            return None
        values, X, inverse, blur = basis
        seen = inverse @ (loop.A_1 @ X)
        return Family(
            centre=t,
            values=values,
            motion=-1j * z * seen,
            bend=-0.5 * z * np.diagonal(seen),
            rest=np.abs(seen),
            blur=blur,
            remainder=_turned,
            real=self.symmetric(t),
            right=X,
            left=inverse,
        )

    def window(self, lower: float, upper: float) -> Window:
        """ω ≥ φ/d for the roots above the real axis, ω ≤ −(2π − φ)/d for those below."""
        if self.at_most == math.inf:
            return WHOLE
        if self.at_most == 0.0:
            return Window(math.inf, -math.inf)
        return Window(lower / self.at_most, -(2.0 * math.pi - upper) / self.at_most)

    def symmetric(self, t: float) -> bool:
        """A_0 ± A_1 is real."""
        return t in (0.0, math.pi)

    def place(self, t: float, value: complex) -> tuple[float, float]:
        """φ is the parameter, ω the eigenvalue's imaginary part."""
        return t, value.imag

    def value(self, phi: float, omega: float) -> complex:
        """jω."""
        return 1j * omega

    def parameter(self, phi: float, omega: float) -> float:
        """φ itself."""
        return phi

    def width(self, t: float) -> float:
        """Share of the distance to the nearer end, and never below what a double resolves."""
        return 2e-9 * max(min(t, math.pi - t), 1e-6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frequency:
    """w = z_0/(z − z_0) over ω, also with an embedded delay.

    Attributes:
        loop: the loop.
        at_most: longest delay that counts, s; inf for all.
        reference: z_0, 1 or −1, for which no root lies on the imaginary axis.
        seen_in: (n, n) basis in which bounds of the resolvent are taken, and its inverse: near the
            eigenvectors they are closer.
    """

    loop: Loop
    at_most: float
    reference: float
    seen_in: tuple[Array, Array]

    @property
    def edges(self) -> list[float]:
        """From rest to where no root can be, closer at low frequencies."""
        top = 1.01 * self.loop.size
        return [0.0, *np.geomspace(1e-3 * top, top, 16).tolist()]

    def family(self, t: float) -> Family | None:
        """Eigenvalues of z_0 G(jω) about ω = t, moved by ½ so that |z| = 1 is the axis.

        P moves by δ = jΔ P' + ε with |ε| ≤ (e^{he} − 1 − he) |A_e|, and G by −C R δ R B + the rest
        C R (δR) (I + δR)⁻¹ δ R B.
        """
        loop, e = self.loop, self.loop.embedded_delay
        P, slope = loop.characteristic(1j * t, self.reference)
        if t == 0.0:
            P, slope = P.real, slope.real
        try:
            R = np.linalg.inv(P)
        except np.linalg.LinAlgError:
            return None
        left, right = loop.C @ R, R @ loop.B
        basis = _eigenbasis(self.reference * (left @ loop.B))
        if basis is None:
            return None
        values, X, inverse, blur = basis
        left, right = inverse @ left, right @ X
        turned = slope @ right
        bent = slope @ (R @ turned) + 0.5 * e**2 * (loop.A_e @ right)
        rounding = (len(P) + 2) * EPS * (np.abs(left) @ np.abs(P) @ np.abs(right))
        V, to = self.seen_in
        seen, late = to @ slope @ R @ V, to @ loop.A_e @ R @ V
        along, across = float(np.linalg.norm(seen, 2)), float(np.linalg.norm(late, 2))
        columns = np.linalg.norm(to @ turned, axis=0)
        columns += e * np.linalg.norm(to @ (loop.A_e @ right), axis=0)

        def remainder(h: float) -> float:
            bent = _turned(h * e)
            moved = 1.0001 * (h * along + bent * across)
            if not moved < 1.0:
                return math.inf
            share = bent / (h * e)
            return h * (max(1.0, share) * moved / (1.0 - moved) + share)

        return Family(
            centre=t,
            values=values + 0.5,
            motion=-1j * self.reference * (left @ turned),
            bend=-self.reference * np.sum(left * bent.T, axis=1),
            rest=np.linalg.norm(left @ V, axis=1)[:, None] * columns,
            blur=blur + rounding,
            remainder=remainder,
            real=self.symmetric(t),
            right=right,
            left=left,
        )

    def window(self, lower: float, upper: float) -> Window:
        """Delay factors with φ ≤ ωd: Im w ≥ ½ cot(ωd/2), where z_0 = 1."""
        phi = upper * self.at_most
        if self.reference < 0.0 or phi >= 2.0 * math.pi:
            return WHOLE
        return Window(0.5 / math.tan(phi / 2.0) if phi > 0.0 else math.inf, -math.inf)

    def symmetric(self, t: float) -> bool:
        """G(0) is real."""
        return t == 0.0

    def place(self, t: float, value: complex) -> tuple[float, float]:
        """ω is the parameter, φ the angle of z = z_0 (1 + 1/w)."""
        z = self.reference * (1.0 + 1.0 / (value - 0.5))
        return -math.atan2(z.imag, z.real) % (2.0 * math.pi), t

    def value(self, phi: float, omega: float) -> complex:
        """w = −½ + ½j cot((φ − φ_0)/2), moved by ½."""
        half = phi / 2.0 if self.reference > 0.0 else (phi - math.pi) / 2.0
        sine = math.sin(half)
        return 0.5j * math.cos(half) / (sine if sine else 1e-300)

    def parameter(self, phi: float, omega: float) -> float:
        """ω itself."""
        return omega

    def width(self, t: float) -> float:
        """Share of the frequency."""
        return 2e-9 * max(t, 1e-9 * self.loop.size)


def frequency_of(loop: Loop, *, at_most: float, reference: float) -> Frequency:
    """Choose the basis in which the resolvent is bounded.

    Args:
        loop: a loop with an embedded delay.
        at_most: longest delay that counts, s; inf for all.
        reference: z_0.
    """
    basis = _eigenbasis(loop.A_0 + reference * loop.A_1 + loop.A_e)
    identity = np.eye(len(loop.A_0))
    seen_in = (identity, identity) if basis is None else basis[1:3]
    return Frequency(loop=loop, at_most=at_most, reference=reference, seen_in=seen_in)


def _turned(h: float) -> float:
    """|e^{-jΔ} − 1 + jΔ| ≤ e^h − 1 − h for complex |Δ| ≤ h."""
    return math.expm1(min(h, 500.0)) - h if h > 1e-4 else 0.5001 * h * h


def _eigenbasis(A: Array) -> tuple[Array, Array, Array, Array] | None:
    """Eigenvalues, eigenvectors, their inverse and a bound of X⁻¹ A X − Λ, entry by entry.

    Where A has no such basis, critically damped joints for one, or rounding leaves little of it,
    the basis is that of a matrix next to A: the bound says what that costs.
    """
    own = _seen_in(A, A)
    norm = float(np.linalg.norm(A))
    if own is not None and own[3].max(initial=0.0) <= _BLURRED * norm:
        return own
    beside = np.random.default_rng(0).normal(size=A.shape) / len(A)
    other = _seen_in(A, A + _BESIDE * norm * beside)
    if own is None or (other is not None and other[3].max() < own[3].max()):
        return other
    return own


def _seen_in(A: Array, near: Array) -> tuple[Array, Array, Array, Array] | None:
    """The same with the eigenvalues and eigenvectors of a matrix near A.

    The bound holds what these leave, as it is computed, and the rounding of the product.
    """
    values, X = np.linalg.eig(near)
    try:
        inverse = np.linalg.inv(X)
    except np.linalg.LinAlgError:
        return None
    size = np.abs(X)
    off = np.abs(inverse @ X - np.eye(len(A))).max()
    if not off < 1e-3:
        return None
    scaled = X * values
    error = np.abs(A @ X - scaled) + (len(A) + 2) * EPS * (np.abs(A) @ size + np.abs(scaled))
    return values, X, inverse, (1.0 + 2.0 * off) * (np.abs(inverse) @ error)
