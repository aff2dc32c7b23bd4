"""Eigenvalues that move with one parameter, and what is certain about them on a whole interval.

The matrix is M(t) = X (Λ + Δ M_1 + rest) X⁻¹ with Δ = t − centre. On |Δ| ≤ h its part off the
diagonal is at most h |M_1| + s(h) S + F entry by entry, with the known remainder s and the rounding
F. Where every eigenvalue keeps a distance D_i from a curve, none reaches the curve if the spectral
norm of D^{-½} (h M_1 + s S + F) D^{-½} is below 1 (Bauer and Fike, weighted). The weights let the
eigenvalue next to the curve move against the others to second order only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sealag.typing import Array

_LINEAR = 2.0
_EVEN = 8.0
_NEAR = 1.5
_DISC = 0.3
_MOST_DISCS = 8


class Window(NamedTuple):
    """The part of the imaginary axis on which a crossing counts: Im ≥ above or Im ≤ below.

    Attributes:
        above: lower end of the upper ray; −inf where the whole axis counts.
        below: upper end of the lower ray; −inf where there is none.
    """

    above: float
    below: float


WHOLE = Window(-np.inf, -np.inf)


class Curve(NamedTuple):
    """One eigenvalue that is isolated about a centre and meets the axis at most once beside it.

    Attributes:
        index: which eigenvalue of the family.
        offset: where it is expected on the axis, Δ.
        even: whether its real part is even in Δ and it is real for Δ = 0.
        bend: b of Re λ = m + b Δ² + … where it is even; 0 otherwise.
        alone: radius of a disc about it, moving with M_kk, that holds no other eigenvalue.
        reach: bound of its distance from Λ_k + Δ (M_1)_kk.
    """

    index: int
    offset: float
    even: bool
    bend: float
    alone: float
    reach: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Eigenvalues about a centre, shifted so that a crossing lies on the imaginary axis.

    Attributes:
        centre: value of the parameter t.
        values: (n,) eigenvalues Λ at the centre.
        motion: (n, n) first derivative M_1 by t in the eigenvectors' basis.
        bend: (n,) diagonal of the second-order term M_2; used where the matrix is real.
        rest: (n, n) bound S of what the remainder multiplies.
        blur: (n, n) bound F of rounding.
        remainder: s(h) on the complex disc |Δ| ≤ h; inf where no bound holds.
        real: whether the matrix at the centre is real and M(−Δ) is the conjugate of M(Δ).
        right: (states, n) null vectors of the characteristic matrix, one an eigenvalue.
        left: (n, states) left null vectors.
    """

    centre: float
    values: Array
    motion: Array
    bend: Array
    rest: Array
    blur: Array
    remainder: Callable[[float], float]
    real: bool
    right: Array
    left: Array

    def excluded(self, h: float, window: Window) -> bool:
        """Whether no eigenvalue is on the window for |Δ| ≤ h."""
        return self._none_on_axis(self._gap(h, window), h)

    def curves(self, h: float, window: Window) -> list[Curve] | None:
        """Eigenvalues that alone can be on the window for |Δ| ≤ h, each at most once; else None.

        An isolated eigenvalue is analytic in a disc of radius R > h and there within ρ of its
        tangent, so that its slope differs from the tangent's by at most ρ/(R − h): where that is
        less than the slope itself, it meets the axis at most once. An even one is treated so as a
        function of Δ², with Cauchy's bounds of its coefficients.
        """
        gap = self._gap(h, window)
        near = (gap <= 0.0) | (np.abs(self.values.real) <= _NEAR * h * np.abs(self._rates.real))
        near &= gap < np.abs(self.values.real)
        near[gap.argmin()] = True
        found: list[Curve] = []
        for k in np.flatnonzero(near):
            curve = self._curve(int(k), h)
            if curve is None:
                return None
            gap[k] = curve.alone
            found.append(curve)
        return found if self._none_on_axis(gap, h) else None

    def blurred(self, h: float) -> bool:
        """Whether rounding hides on which side the nearest eigenvalue is, and to split is vain."""
        k = int(np.abs(self.values.real).argmin())
        rounding = self.blur[k, k]
        moved = h * abs(self._rates[k].real) + self.remainder(h) * self.rest[k, k]
        return bool(abs(self.values[k].real) <= 4.0 * rounding and moved <= rounding)

    @property
    def rests(self) -> bool:
        """Whether the eigenvalue nearest to the axis is one of a real matrix and real itself."""
        return self.real and self.values[np.abs(self.values.real).argmin()].imag == 0.0

    @property
    def _rates(self) -> Array:
        return np.diagonal(self.motion)

    def _gap(self, h: float, window: Window) -> Array:
        """(n,) distances that the eigenvalues keep from the window, were they not coupled."""
        slack = self.remainder(h) * np.diagonal(self.rest) + np.diagonal(self.blur)
        real, imag = np.abs(self.values.real), self.values.imag
        gap = real - h * np.abs(self._rates.real)
        if window.above > -np.inf:
            outside = np.maximum(np.minimum(window.above - imag, imag - window.below), 0.0)
            gap = np.maximum(gap, np.hypot(real, outside) - h * np.abs(self._rates))
        return gap - slack

    def _none_on_axis(self, D: Array, h: float) -> bool:
        """Whether no eigenvalue is on the window, where D are their distances to what counts of it.

        A point of the axis is near one eigenvalue at most: where two of them are near the axis,
        the discs about each are looked at one by one, and the rest of the axis outside the discs.
        """
        if self._clear(D, h):
            return True
        if not (D > 0.0).all() or not np.isfinite(self.remainder(h)):
            return False
        apart = self._apart(h)
        same = apart <= _DISC**-2 * np.maximum(D[:, None], D)  # equal joints: looked at together
        radius = _DISC * np.where(same, np.inf, apart).min(axis=1)
        radius = np.minimum(radius, 1e300)
        near = np.minimum(radius, h * np.abs(self.motion).max(axis=1)) > D
        if not 2 <= near.sum() <= _MOST_DISCS or not self._clear(np.where(near, radius, D), h):
            return False
        for k in np.flatnonzero(near):
            inside = np.where(same[k], D, np.maximum(D, apart[k] - radius[k]))
            inside[k] = D[k]
            if not self._clear(inside, h):
                return False
        return True

    def _apart(self, h: float) -> Array:
        """(n, n) distances that the uncoupled eigenvalues keep from each other for |Δ| ≤ h."""
        slack = self.remainder(h) * np.diagonal(self.rest) + np.diagonal(self.blur)
        apart = np.abs(self.values[:, None] - self.values)
        apart -= h * np.abs(self._rates[:, None] - self._rates) + slack + slack[:, None]
        np.fill_diagonal(apart, np.inf)
        return apart

    def _clear(self, D: Array, h: float) -> bool:
        """Whether ‖D^{-½} (h M_1 + s S + F) D^{-½}‖ < 1 without the diagonal."""
        s = self.remainder(h)
        if not (np.isfinite(s) and (D > 0.0).all()):
            return False
        scale = 1.0 / np.sqrt(D)
        scale = np.minimum(scale, 1e150)
        known = h * (self.motion * scale) * scale[:, None]
        unknown = ((s * self.rest + self.blur) * scale) * scale[:, None]
        np.fill_diagonal(known, 0.0)
        np.fill_diagonal(unknown, 0.0)
        left = 1.0 - _norm_bound(unknown)
        if left <= 0.0:
            return False
        bound = _norm_bound(known)
        if bound < left or bound > np.sqrt(len(D)) * left:
            return bound < left
        return bool(1.0001 * np.linalg.norm(known, 2) < left)

    def _curve(self, k: int, h: float) -> Curve | None:
        value, rate = self.values[k], self._rates[k]
        if self.real and value.imag == 0.0:
            return self._even_curve(k, h)
        R = _LINEAR * h
        curve = self._isolated(k, R, reach=0.98 * (R - h) * abs(rate.real))
        return curve and curve._replace(offset=float(-value.real / rate.real))

    def _even_curve(self, k: int, h: float) -> Curve | None:
        """A real eigenvalue of a real matrix: Re λ = m + b Δ² + …, with |c_2j| ≤ ρ/R^{2j}."""
        others = np.delete(np.arange(len(self.values)), k)
        apart = self.values[k] - self.values[others]
        if not apart.all():
            return None
        second = (self.motion[k, others] * self.motion[others, k] / apart).sum()
        bend = float((self.bend[k] + second).real)
        tail = 1.0 / (1.0 - _EVEN**-2) ** 2 - 1.0
        R = _EVEN * h
        curve = self._isolated(k, R, reach=0.9 * abs(bend) * R**2 / tail)
        square = -float(self.values[k].real) / bend if bend else 0.0
        offset = float(np.copysign(np.sqrt(abs(square)), square))
        return curve and curve._replace(offset=offset, even=True, bend=bend)

    def _isolated(self, k: int, R: float, *, reach: float) -> Curve | None:
        """Two discs about eigenvalue k for complex |Δ| ≤ R: in the larger one none is but k, and k
        is in the smaller one, which keeps it within reach of its tangent; None if there are none.
        """
        s = self.remainder(R)
        if not np.isfinite(s):
            return None
        slack = s * np.diagonal(self.rest) + np.diagonal(self.blur)
        D = np.abs(self.values - self.values[k]) - R * np.abs(self._rates - self._rates[k])
        D = D - slack - slack[k]
        D[k] = np.inf
        alone = min(_DISC * float(D.min()), 1e300)
        radius = min(reach - float(slack[k]), alone)
        if radius <= 0.0:
            return None
        D = D - alone
        D[k] = radius
        if not self._clear(D, R):
            return None
        reach = radius + float(slack[k])
        return Curve(k, 0.0, even=False, bend=0.0, alone=alone, reach=reach)


def _norm_bound(M: Array) -> float:
    """Bound of the spectral norm that costs no singular values."""
    size = np.abs(M)
    mixed = np.sqrt(size.sum(axis=0).max() * size.sum(axis=1).max())
    return float(min(np.linalg.norm(size), mixed))
