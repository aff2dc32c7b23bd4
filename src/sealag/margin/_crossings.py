"""Crossings of the imaginary axis, refined to rounding from the bands that the sweep left."""

import math
from dataclasses import dataclass

import numpy as np

from sealag.margin._loop import Loop, Transfer
from sealag.margin._sweep import Cluster, slow_limit
from sealag.typing import Array

_ON_LINE = 1e-5
_SLOW = 1e-6
_STEPS = 30
_EXACT = 1e-12
_STATIC = 1e-8
_APART = 1e-2
_REACH = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A root jω that lies on the imaginary axis for delays (φ + 2πk)/ω.

    Attributes:
        delay: shortest such delay, s.
        frequency: ω, rad/s.
        direction: +1 when the root leaves the left half-plane as the delay grows, −1 when it
            enters, 0 when it touches the axis.
        mode: (states,) complex eigenvector over the states, its largest entry 1.
        residual: smallest singular value of jωI − A_0 − A_1 e^{-jωd} over the loop's norm.
    """

    delay: float
    frequency: float
    direction: int
    mode: Array
    residual: float

    @property
    def period(self) -> float:
        """Time 2π/ω after which the same root lies on the axis again, s."""
        return 2.0 * math.pi / self.frequency


def crossings_in(transfer: Transfer, bands: list[Cluster]) -> tuple[list[Crossing], bool]:
    """Refine what the sweep left.

    Args:
        transfer: G about its reference.
        bands: bands of frequencies from the sweep.

    Returns:
        The crossings by delay, and whether every band is explained by one of them.
    """
    found: list[Crossing] = []
    explained = True
    for band in bands:
        if _touches_at_zero(transfer, band):
            continue
        middle = (band.lower + band.upper) / 2.0
        nu = np.linalg.eigvals(transfer.reference * transfer.near(middle)[0])
        starts = nu[_near_line(nu, _ON_LINE)]
        reach = _REACH * middle + 2.0 * (band.upper - band.lower)
        here = [_refine(transfer, middle, nu=value, reach=reach) for value in starts]
        refined = [crossing for crossing in here if crossing is not None]
        found += refined
        explained &= bool(here) and len(refined) == len(here)
    return sorted(found, key=lambda crossing: crossing.delay), explained


def _touches_at_zero(transfer: Transfer, band: Cluster) -> bool:
    """Whether a band is a contact at zero frequency itself, which no finite delay reaches.

    A_0 + z A_1 is then singular for a z ≠ 1 of modulus 1, and the band lies far below every pole.
    """
    if band.upper > 1.1 * slow_limit(transfer):
        return False
    nu = np.linalg.eigvals(transfer.reference * transfer.near(0.0)[0])
    z = transfer.reference * (1.0 + 1.0 / nu[_near_line(nu, _STATIC)])
    return bool(len(z)) and bool((np.abs(np.angle(z)) > _APART).all())


def _near_line(nu: Array, tolerance: float) -> Array:
    """Eigenvalues whose delay factor has modulus 1 to a tolerance: |z| − 1 ≈ (Re ν + ½)/|ν|²."""
    return np.abs(nu.real + 0.5) < tolerance * np.maximum(np.abs(nu) ** 2, np.abs(nu))


def _refine(transfer: Transfer, omega: float, *, nu: complex, reach: float) -> Crossing | None:
    """Newton's method on Re(z_0 ν(ω)) = −½; where the root only touches, on its slope."""
    start, best = omega, (math.inf, omega, nu, 0j)
    for _ in range(_STEPS):
        value, slope = _track(transfer, omega, nu=nu)
        miss = value.real + 0.5
        if abs(miss) < best[0]:
            best = (abs(miss), omega, value, slope)
        elif abs(miss) < _EXACT * abs(value):
            break
        rate = (1j * slope).real
        if abs(miss) < 4e-16 * abs(value) or rate == 0.0:
            break
        step = float(np.clip(miss / rate, -reach, reach))
        if omega - step == omega:
            break
        omega, nu = omega - step, value - 1j * slope * step
    _, omega, value, slope = best
    if _turn(value, slope) == 0:
        omega, value, slope = _nearest(transfer, omega, nu=value)
    if abs(omega - start) > reach or not _near_line(np.array([value]), _ON_LINE)[0]:
        return None
    return _crossing(transfer, omega, value=value, slope=slope)


def _nearest(transfer: Transfer, omega: float, *, nu: complex) -> tuple[float, complex, complex]:
    """Secant method on the slope of Re(z_0 ν): the frequency where a touching root touches."""
    other = omega * (1.0 + 1e-6)
    value, slope = _track(transfer, omega, nu=nu)
    rate, rate_other = (1j * slope).real, (1j * _track(transfer, other, nu=nu)[1]).real
    for _ in range(_STEPS):
        if rate == rate_other or abs(other - omega) <= 1e-13 * omega:
            break
        new = omega - rate * (omega - other) / (rate - rate_other)
        if not abs(new - omega) <= _REACH * omega:
            break
        other, rate_other, omega = omega, rate, new
        value, slope = _track(transfer, omega, nu=value)
        rate = (1j * slope).real
    return omega, value, slope


def _turn(value: complex, slope: complex) -> int:
    """Sign of Re(dλ/dd), which is the same for every k in d = (φ + 2πk)/ω.

    From ν (z − z_0) = 1 and z = e^{-λd}, with ν here z_0 ν, it is that of
    Im((dν/dλ) / (ν (ν + 1))).
    """
    rise = slope / (value * (value + 1.0)) * -1j
    if abs(rise.real) < _SLOW * abs(rise):
        return 0
    return int(math.copysign(1.0, rise.real))


def _track(transfer: Transfer, omega: float, *, nu: complex) -> tuple[complex, complex]:
    """Eigenvalue of z_0 G nearest to nu, and its derivative by λ = jω."""
    G, derivative = transfer.near(omega)
    values, X = np.linalg.eig(transfer.reference * G)
    at = int(np.abs(values - nu).argmin())
    try:
        left = np.linalg.inv(X)[at]
    except np.linalg.LinAlgError:
        return complex(values[at]), 0j
    return complex(values[at]), complex(transfer.reference * (left @ derivative @ X[:, at]))


def _crossing(transfer: Transfer, omega: float, *, value: complex, slope: complex) -> Crossing:
    z_0 = transfer.reference
    z = z_0 * (1.0 + 1.0 / value)
    angle = -math.atan2(z.imag, z.real) % (2.0 * math.pi)
    delay, omega = float(angle / omega), float(omega)
    mode, residual = mode_at(transfer.loop, omega, delay)
    return Crossing(
        delay=delay, frequency=omega, direction=_turn(value, slope), mode=mode, residual=residual
    )


def mode_at(loop: Loop, omega: float, delay: float) -> tuple[Array, float]:
    """Null vector of the characteristic matrix at jω.

    Args:
        loop: the loop.
        omega: frequency, rad/s.
        delay: delay, s.

    Returns:
        The mode over the user's states with largest entry 1, and the relative residual.
    """
    factor = np.exp(-1j * omega * delay)
    P = 1j * omega * np.eye(len(loop.A_0)) - loop.A_0 - factor * loop.A_1
    _, values, rows = np.linalg.svd(P)
    mode = loop.lift @ rows[-1].conj()
    return mode / mode[np.abs(mode).argmax()], float(values[-1] / loop.size)
