"""The exact local margin of a certificate, checked again in floating point from its frozen loop.

ẍ + R ẋ + P x + L x(t − d) = 0. With Δ_z(ω) = P − ω² + jωR + zL and z = e^{-jωd}, the phase of
det Δ_z(ω) / det Δ_1(ω) along the imaginary axis turns once for every two roots that the delay d
adds to the right half plane (argument principle; both determinants have the same leading term).
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from sealag.passivity._checks import Check
from sealag.passivity._definite import EPS
from sealag.passivity._inequalities import AGREEMENT
from sealag.typing import Array

_SHARES = (0.25, 0.5, 0.75, 0.999)
"""Shares of the first crossing at which roots are counted."""

COUPLED = 1e-6
"""Share of the delayed stiffness from which an answer to passive motions counts."""

_STRUCTURE = 1e-8
_TURN = 0.5
_MOST = 60_000
_CHUNK = 512


def local_checks(data: dict[str, Any]) -> Iterator[Check]:
    """Check margin, first crossing, unstable modes and the potential's minimum, in doubles.

    Args:
        data: the certificate as plain data.

    Raises:
        ValueError: matrices do not fit each other.
    """
    loop, margin, crossing = data["local_loop"], data["local_margin_s"], data["first_crossing_s"]
    if loop is None:
        silent = margin is None and crossing is None and data["stable"] is None
        words = "no frozen loop is in the file, and nothing is claimed of it"
        ok = silent and data["unstable_modes"] == 0
        yield Check(name="local margin", ok=ok, detail=words if ok else "claimed without a loop")
        return
    P, R, L, V = (np.array(loop[key], dtype=float) for key in ("P", "R", "L", "symmetries"))
    V = V.reshape(len(P), -1)
    if not P.shape == R.shape == L.shape == (len(P), len(P)) or not len(P) >= len(data["joints"]):
        raise ValueError("the frozen loop's matrices do not fit each other")
    yield _motors(data, P=P, R=R, L=L)
    lost = max((float(np.abs(A @ V).max(initial=0.0)) / _size(A) for A in (P, R, L)), default=0.0)
    yield Check(
        name="frozen loop: symmetries",
        ok=lost <= _STRUCTURE,
        detail=f"{V.shape[1]} directions along which nothing acts, to {lost:.1e}",
    )
    rest = np.linalg.svd(V, full_matrices=True)[0][:, np.linalg.matrix_rank(V) :]
    P, R, L = (rest.T @ A @ rest for A in (P, R, L))
    yield _minimum(data, P + L, coupled=_coupled(data))
    roots, error = _roots(P + L, R)
    yield _unstable(data, roots, error)
    words = f"{margin} s with a first crossing at {crossing} s"
    expected = 0.0 if data["unstable_modes"] else crossing
    yield Check(name="local margin", ok=margin == expected, detail=words)
    if crossing is not None:
        yield _on_axis(P, R, L, delay=float(crossing), omega=float(loop["frequency_rad_s"]))
        yield _count(P, R, L, roots, delay=float(crossing), omega=float(loop["frequency_rad_s"]))


def _size(A: Array) -> float:
    return max(float(np.abs(A).max(initial=0.0)), 1e-300)


def _motors(data: dict[str, Any], *, P: Array, R: Array, L: Array) -> Check:
    """That the motors' rows hold the file's K, D_θ and F over B_s."""
    D, K = (np.array(data[key], dtype=float) for key in ("D_theta", "spring_stiffness"))
    loop = data["local_loop"]
    B, D_s = (np.array(loop[key], dtype=float) for key in ("motor_inertia", "spring_damping"))
    k = len(P) - len(K)
    gaps = [np.abs(B[:, None] * P[k:, k:] - np.diag(K)).max() / K.max()]
    gaps += [np.abs(B[:, None] * R[k:, k:] - np.diag(D + D_s)).max() / D.max()]
    proof = [p for p in data["proofs"] if p["instant"] == data["worst"]["instant"]]
    if proof and data["criterion"] == "certified":
        F = np.array(proof[0]["F"], dtype=float)
        gaps += [np.abs(B[:, None] * L[k:, k:] - F).max() / _size(F)]
        gaps += [np.abs(L[:k]).max(initial=0.0) / _size(L)]
    gap = float(max(gaps))
    return Check(
        name="frozen loop: motors",
        ok=bool((B > 0.0).all() and (D_s >= 0.0).all()) and gap <= AGREEMENT,
        detail=f"K, D and F of the file over the motors' inertia, to {max(gap, 0.0):.1e}",
    )


def _coupled(data: dict[str, Any]) -> bool:
    """Whether the law answers to motions of the base besides those of the motors."""
    L = np.array(data["local_loop"]["L"], dtype=float)
    aside = np.abs(L[:, : len(L) - len(data["joints"])]).max(initial=0.0)
    return data["feedback"] != "joint" and bool(aside > COUPLED * _size(L))


def _minimum(data: dict[str, Any], stiffness: Array, *, coupled: bool) -> Check:
    """M⁻¹ ∂²V, with M ≻ 0, has as many positive eigenvalues as the Hessian ∂²V."""
    if coupled:
        return Check(
            name="stable without delay",
            ok=data["stable"] in (None, data["unstable_modes"] == 0),
            detail=f"{data['stable']} claimed; the law has no potential where it answers to "
            "passive motions of the base, so that the unstable modes decide",
        )
    values = np.linalg.eigvals(stiffness)
    lowest = float(values.real.min(initial=math.inf))
    room = 1e-9 * _size(values)
    claimed = data["stable"]
    ok = claimed is None or (claimed and lowest > 0.0) or (not claimed and lowest <= room)
    words = f"lowest squared frequency {lowest:.6g} 1/s2"
    return Check(name="potential has a minimum", ok=ok, detail=f"{claimed} claimed, {words}")


def _roots(P: Array, R: Array) -> tuple[Array, Array]:
    """Eigenvalues of ẍ + R ẋ + P x = 0 with first-order bounds of their rounding errors."""
    rate = math.sqrt(_size(P))
    eye = np.eye(len(P))
    A = np.block([[0.0 * eye, rate * eye], [-P / rate, -R]])
    values, X = np.linalg.eig(A)
    backward = 8.0 * len(A) * EPS * float(np.linalg.norm(A, 2))
    condition = np.linalg.norm(X, axis=0) * np.linalg.norm(np.linalg.inv(X), axis=1)
    worst = np.cbrt(backward * float(np.linalg.norm(A, 2)) ** 2)
    return values, np.minimum(backward * condition, worst)


def _unstable(data: dict[str, Any], roots: Array, error: Array) -> Check:
    sure, doubtful = int((roots.real > error).sum()), int((np.abs(roots.real) <= error).sum())
    claimed = data["unstable_modes"]
    return Check(
        name="unstable modes without delay",
        ok=sure <= claimed <= sure + doubtful,
        detail=f"{claimed} claimed, {sure} right of the axis, {doubtful} on it, floating point",
    )


def _on_axis(P: Array, R: Array, L: Array, *, delay: float, omega: float) -> Check:
    """Whether jω is an eigenvalue of the loop with the delayed part times e^{-jωd}."""
    roots, error = _roots(P + np.exp(-1j * omega * delay) * L, R)
    at = int(np.abs(roots - 1j * omega).argmin())
    far, room = float(abs(roots[at] - 1j * omega)), float(error[at]) + 1e-9 * omega
    return Check(
        name="root on the axis at the first crossing",
        ok=omega > 0.0 and delay > 0.0 and far <= room,
        detail=f"{omega:.6g}j rad/s is a root to {far:.1e}, floating point",
    )


def _count(P: Array, R: Array, L: Array, roots: Array, *, delay: float, omega: float) -> Check:
    """Roots that delays below the first crossing add to the right half plane: none; a loop that is
    unstable without delay may lose some there."""
    added = [_added(P, R, L, roots, delay=share * delay, omega=omega) for share in _SHARES]
    at = ", ".join(f"{share * delay:.6g}" for share in _SHARES)
    words = ", ".join("?" if number is None else f"{number:+d}" for number in added)
    return Check(
        name="no root crosses before",
        ok=all(
            after is not None and before is not None and after <= before
            for before, after in zip([0, *added], added)
        ),
        detail=f"{words} roots right of the axis with delays of {at} s, argument principle in "
        "floating point",
    )


def _added(P: Array, R: Array, L: Array, roots: Array, *, delay: float, omega: float) -> int | None:
    """Roots in the right half plane with the delay less those without; None if unresolved."""
    grid = _grid(roots, omega)
    values = _ratio(P, R, L, grid, delay)
    while len(grid) < _MOST:
        step = values[1:] / values[:-1]
        turn = np.maximum(np.abs(np.angle(step)), np.abs(np.log(np.abs(step))))
        far = np.abs(values - 1.0)
        late = (np.diff(grid) * delay > _TURN) & (np.maximum(far[1:], far[:-1]) > 0.1)
        split = np.flatnonzero(~(turn <= _TURN) | late)
        split = split[np.diff(grid)[split] > 1e-13 * grid[split]]
        if not len(split):
            turns = -float(np.angle(step).sum()) / math.pi
            settled = abs(values[-1] - 1.0) < 0.1 and abs(turns - round(turns)) < 0.1
            return round(turns) if settled else None
        fresh = (grid[split] + grid[split + 1]) / 2.0
        order = np.argsort(np.concatenate([grid, fresh]), kind="stable")
        grid = np.concatenate([grid, fresh])[order]
        values = np.concatenate([values, _ratio(P, R, L, fresh, delay)])[order]
    return None


def _grid(roots: Array, omega: float) -> Array:
    """Frequencies to begin with: all decades, and close to roots and the crossing."""
    sizes = np.abs(roots)
    low, high = 1e-4 * min(float(sizes.min()), omega), 30.0 * float(sizes.max())
    spread = np.concatenate([-np.geomspace(1e-3, 3.0, 6)[::-1], [0.0], np.geomspace(1e-3, 3.0, 6)])
    near = roots.imag[:, None] + spread * np.abs(roots.real)[:, None]
    close = omega * (1.0 + 1e-2 * spread)
    grid = np.concatenate([np.geomspace(low, high, 300), near.ravel(), close])
    return np.unique(grid[(grid >= low) & (grid <= high)])


def _ratio(P: Array, R: Array, L: Array, omega: Array, delay: float) -> Array:
    """det Δ_z(ω) / det Δ_1(ω), (N,)."""
    out = np.empty(len(omega), dtype=complex)
    for first in range(0, len(omega), _CHUNK):
        w = omega[first : first + _CHUNK, None, None]
        free = P + L - w**2 * np.eye(len(P)) + 1j * w * R
        sign, size = np.linalg.slogdet(free + (np.exp(-1j * w * delay) - 1.0) * L)
        sign_0, size_0 = np.linalg.slogdet(free)
        out[first : first + _CHUNK] = sign / sign_0 * np.exp(size - size_0)
    return out
