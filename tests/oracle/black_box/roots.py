"""Roots of ẋ = A_0 x + Σ B_i C_i x(t − d_i): collocation, and a scan of the unit circle."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import linear_sum_assignment

NODES = 24
"""Chebyshev intervals on a delay: |s d| up to about 10 keeps rounding accuracy."""
FIRST_CELLS = 64
"""Cells of the unit circle before bisection."""
MOST_SPECTRA = 4000
"""Points of the unit circle at most; a scan that needs more has lost its way."""
ROUNDED = 1e-15
"""Of the characteristic matrix: a smaller value is 0."""
DEEPEST = 1e-9
CLUSTER = 1e-6
"""Relative distance below which eigenvalues share one subspace."""
AXIS = 1e-9
"""Real parts below this share of a root's size are on the imaginary axis."""


class ScanLost(RuntimeError):
    """The scan of the unit circle does not end, or contradicts the roots at a delay."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Late:
    """A signal C x that acts through B after a delay, s."""

    B: np.ndarray
    C: np.ndarray
    delay: float


def collocated(A_0: np.ndarray, late: list[Late], *, nodes: int = NODES) -> np.ndarray:
    """Return a matrix whose rightmost eigenvalues are those of the delayed loop.

    Each late signal becomes p(σ) = C x(t + σ) on −d ≤ σ ≤ 0 with ∂p/∂t = ∂p/∂σ, collocated at
    Chebyshev points.
    """
    late = [one for one in late if one.C.size]
    now = A_0 + sum((one.B @ one.C for one in late if one.delay == 0.0), np.zeros_like(A_0))
    late = [one for one in late if one.delay > 0.0]
    size = len(A_0)
    total = size + sum(nodes * len(one.C) for one in late)
    A = np.zeros((total, total))
    A[:size, :size] = now
    first = size
    for one in late:
        D = _differentiation(nodes) * 2.0 / one.delay
        m = len(one.C)
        block = slice(first, first + nodes * m)
        A[block, block] = np.kron(D[1:, 1:], np.eye(m))
        A[block, :size] = np.kron(D[1:, :1], one.C)
        A[:size, first + (nodes - 1) * m : first + nodes * m] = one.B
        first += nodes * m
    return A


def _differentiation(N: int) -> np.ndarray:
    """Chebyshev differentiation matrix on [−1, 1], first node at 1."""
    x = np.cos(np.pi * np.arange(N + 1) / N)
    c = np.r_[2.0, np.ones(N - 1), 2.0] * (-1.0) ** np.arange(N + 1)
    gaps = x[:, None] - x[None, :] + np.eye(N + 1)
    D = np.outer(c, 1.0 / c) / gaps
    return D - np.diag(D.sum(axis=1))


def roots(A_0: np.ndarray, late: list[Late]) -> np.ndarray:
    """Return the roots of the loop, the rightmost ones accurately.

    They are polished by Newton's method on the characteristic matrix where a delay is not 0.
    """
    found = eigvals(collocated(A_0, late))
    if all(one.delay == 0.0 for one in late):
        return found
    slow = 5.0 / max(one.delay for one in late)
    right = found[(found.real > -slow) & (found.imag >= 0.0)]
    kept = [polished(A_0, late, s) for s in sorted(right, key=lambda s: -s.real)[:12]]
    good = np.array([s for s in kept if s is not None])
    return np.concatenate([good, good[np.abs(good.imag) > 0.0].conj()])


def polished(A_0: np.ndarray, late: list[Late], s: complex) -> complex | None:
    """Return the root next to s, or None if Newton's method leaves."""
    first = s
    for _ in range(12):
        T, slope = _characteristic(A_0, late, s)
        w, v = _null_vectors(T)
        step = (w @ T @ v) / (w @ slope @ v)
        s = s - step
        if not abs(s - first) < 0.1 * (1.0 + abs(first)):
            return None
        if abs(step) < 1e-13 * (1.0 + abs(s)):
            break
    return s if abs(s - first) < 1e-2 * (1.0 + abs(first)) else None


def _characteristic(A_0: np.ndarray, late: list[Late], s: complex) -> tuple[np.ndarray, np.ndarray]:
    """s I − A_0 − Σ B C e^(−s d), and its derivative in s."""
    T, slope = s * np.eye(len(A_0)) - A_0, np.eye(len(A_0), dtype=complex)
    for one in late:
        turned = one.B @ one.C * np.exp(-s * one.delay)
        T = T - turned
        slope = slope + one.delay * turned
    return T, slope


def _null_vectors(T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    U, _, Vh = np.linalg.svd(T)
    return U[:, -1].conj(), Vh[-1].conj()


def unstable_count(found: np.ndarray) -> tuple[int, float]:
    """Return how many roots are not left of the axis, and how near to it the nearest one is.

    The nearness is |Re s| / (1 + |s|).
    """
    near = np.abs(found.real) / (1.0 + np.abs(found))
    nearest = float(near.min()) if len(near) else np.inf
    return int((found.real > -AXIS * (1.0 + np.abs(found))).sum()), nearest


def crossings(A_0: np.ndarray, fixed: list[Late], late: Late) -> list[tuple[float, float]]:
    """Return delay and frequency of every root that lies on the axis at some delay of `late`.

    The eigenvalues of A_0 + e^(−iφ) B C along the unit circle are followed by adaptive bisection;
    where one passes the imaginary axis at iω, delays (φ + 2πk) / ω put a root there. Fixed delays
    are collocated, then the pair is polished on the exact characteristic matrix.
    """
    A = collocated(A_0, fixed)
    B = np.zeros((len(A), late.B.shape[1]))
    B[: len(A_0)] = late.B
    C = np.zeros((late.C.shape[0], len(A)))
    C[:, : len(A_0)] = late.C
    turned = B @ C
    out = []
    for phi, omega in _passages(A, turned):
        turn = phi if omega > 0.0 else -phi  # a real loop: the conjugate passage
        delay, frequency = (turn % (2.0 * np.pi)) / abs(omega), abs(omega)
        exact = _exact_crossing(A_0, fixed, late, delay, frequency)
        if exact is not None:
            out.append(exact)
    return sorted(out)


def first_crossing(A_0: np.ndarray, fixed: list[Late], late: Late) -> tuple[float, float]:
    """Return delay and frequency of the first crossing of a loop that is stable without delay.

    Newton's method proves that a root is there; collocated roots, none of them right of the axis
    at shorter delays, confirm that none was before.

    Raises:
        ScanLost: they contradict.
    """
    found = crossings(A_0, fixed, late)
    delay, omega = found[0] if found else (np.inf, np.nan)
    if not len(late.C):
        return delay, omega
    sizes = np.abs(np.linalg.eigvals(A_0))
    longest = 8.0 / max(float(sizes.max()), 1e-3)  # what collocation resolves
    shares = (0.5, 0.9, 0.999)
    before = [s * delay for s in shares] if found else [s * 100.0 * longest for s in shares]
    for d in before:
        if unstable_at(A_0, fixed, late, d):
            raise ScanLost(f"a root is right of the axis at {d:.6g} s, before {delay:.6g} s")
    return delay, omega


def unstable_at(A_0: np.ndarray, fixed: list[Late], late: Late, delay: float) -> bool:
    """Return whether a root is right of the axis at a delay, from collocation."""
    moved = Late(B=late.B, C=late.C, delay=delay)
    found = eigvals(collocated(A_0, [*fixed, moved]))
    for s in sorted(found, key=lambda s: -s.real)[:6]:
        exact = polished(A_0, [*fixed, moved], s) if s.real > -1e-3 * (1.0 + abs(s)) else None
        if exact is not None and exact.real > 0.0:
            return True
    return False


def _exact_crossing(
    A_0: np.ndarray, fixed: list[Late], late: Late, delay: float, omega: float
) -> tuple[float, float] | None:
    """Newton's method for the pair delay, ω with a root at iω."""
    first = delay, omega
    for _ in range(20):
        moved = Late(B=late.B, C=late.C, delay=delay)
        T, slope = _characteristic(A_0, [*fixed, moved], 1j * omega)
        w, v = _null_vectors(T)
        value = w @ T @ v
        if abs(value) <= ROUNDED * float(np.linalg.norm(T, 2)):
            break  # where a root only touches the axis, a further step would lead away
        by_omega = 1j * (w @ slope @ v)
        by_delay = 1j * omega * np.exp(-1j * omega * delay) * (w @ late.B @ late.C @ v)
        J = np.array([[by_omega.real, by_delay.real], [by_omega.imag, by_delay.imag]])
        try:
            step = np.linalg.solve(J, [value.real, value.imag])
        except np.linalg.LinAlgError:
            return None
        omega, delay = omega - step[0], delay - step[1]
        if abs(step[0]) < 1e-13 * omega and abs(step[1]) < 1e-13 * (delay + 1.0 / omega):
            break
    near = abs(omega - first[1]) < 1e-3 * first[1] and abs(delay - first[0]) * omega < 1e-2
    return (float(delay), float(omega)) if near and delay > 0.0 else None


def _passages(A: np.ndarray, turned: np.ndarray) -> list[tuple[float, float]]:
    """(φ, ω) where an eigenvalue of A + e^(−iφ) turned passes the axis, 0 ≤ φ ≤ π.

    The matrices are real: passages at −φ are the conjugate ones.
    """
    grid = np.linspace(0.0, np.pi, FIRST_CELLS // 2 + 1)
    found: list[tuple[float, float]] = []
    at = [(phi, *_spectrum(A, turned, phi)) for phi in grid]
    cells, spectra = list(pairwise(at)), len(at)
    floor = 1e-14 * float(np.linalg.norm(A, 2))
    while cells:
        left, right = cells.pop()
        passages = _cell(left, right, floor)
        if passages is None and right[0] - left[0] > DEEPEST:
            middle = 0.5 * (left[0] + right[0])
            between = (middle, *_spectrum(A, turned, middle))
            spectra += 1
            if spectra > MOST_SPECTRA:
                raise ScanLost(f"{MOST_SPECTRA} spectra do not follow the eigenvalues")
            cells += [(left, between), (between, right)]
        else:
            found += passages or []
    return found


def _spectrum(A: np.ndarray, turned: np.ndarray, phi: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of A + e^(−iφ) turned, and their derivatives in φ.

    Eigenvalues that coincide move by the eigenvalues of the derivative on their common subspace.
    """
    late = np.exp(-1j * phi) * turned
    values, V = np.linalg.eig(A + late)
    try:
        moved = np.linalg.solve(V, -1j * late @ V)
    except np.linalg.LinAlgError:
        moved = np.linalg.pinv(V) @ (-1j * late @ V)
    rates = np.diag(moved).copy()
    order = np.argsort(values.real)
    values, rates, moved = values[order], rates[order], moved[np.ix_(order, order)]
    near = np.abs(values[:, None] - values[None, :]) < CLUSTER * (1.0 + np.abs(values))
    for k in np.flatnonzero(near.sum(axis=1) > 1):
        group = np.flatnonzero(near[k])
        if group[0] == k:
            rates[group] = np.linalg.eigvals(moved[np.ix_(group, group)])
    return values, rates


def _cell(left: tuple, right: tuple, floor: float) -> list[tuple[float, float]] | None:
    """Passages in a cell by cubic interpolation; None if it is too wide to tell."""
    a, values_a, rates_a = left
    b, values_b, rates_b = right
    h = b - a
    ahead = values_a + 0.5 * h * rates_a
    back = values_b - 0.5 * h * rates_b
    cost = np.abs(ahead[:, None] - back[None, :])
    rows, columns = linear_sum_assignment(cost)
    out = []
    for i, j in zip(rows, columns, strict=True):
        x, y = values_a[i], values_b[j]
        dx, dy = h * rates_a[i], h * rates_b[j]
        reach = max(abs(dx), abs(dy), abs(y - x))
        if min(abs(x.real), abs(y.real)) > 2.0 * reach + 4.0 * cost[i, j]:
            continue
        if cost[i, j] > 0.05 * max(reach, 1e-7 * (1.0 + abs(x)), 100.0 * floor):
            return None
        if reach < 1e-12 * (1.0 + abs(x)):
            continue  # the delayed signal does not move it
        real = np.array([2 * (x - y) + dx + dy, 3 * (y - x) - 2 * dx - dy, dx, x]).real
        for t in np.roots(real):
            if abs(t.imag) < 0.05 and -0.02 <= t.real <= 1.02:
                t = t.real
                value = ((1 - t) ** 2 * (1 + 2 * t)) * x + t**2 * (3 - 2 * t) * y
                value += t * (1 - t) ** 2 * dx - t**2 * (1 - t) * dy
                if abs(value.imag) > 1e-12:
                    out.append((a + t * h, value.imag))
    return out
