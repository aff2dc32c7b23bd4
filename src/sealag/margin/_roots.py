"""Rightmost characteristic roots by Chebyshev pseudospectral discretisation."""

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike


def rightmost_roots(
    A_0: ArrayLike, A_1: ArrayLike, delay: float, *, nodes: int | None = None
) -> Array:
    """Compute the rightmost roots of det(sI − A_0 − A_1 e^{−sd}) = 0.

    The infinitesimal generator on [−d, 0] is collocated at Chebyshev points (Breda, Maset,
    Vermiglio, SIAM J. Sci. Comput. 2005); each root is then corrected by Newton's method on the
    characteristic equation. Roots that Newton moves far are artefacts and are left out.

    Args:
        A_0: (N, N) what acts without delay.
        A_1: (N, N) what acts with delay.
        delay: d, s.
        nodes: degree of the polynomials; chosen from the norms and the delay if None.

    Returns:
        (k,) complex roots by falling real part.

    Raises:
        InputError: the delay is negative or not finite.
    """
    first, second = np.asarray(A_0, dtype=float), np.asarray(A_1, dtype=float)
    if not (np.isfinite(delay) and delay >= 0.0):
        raise InputError(f"The delay is {delay}; a finite, not negative time in s is needed.")
    if delay == 0.0:
        roots = np.linalg.eigvals(first + second)
        return roots[np.argsort(-roots.real)]
    size = len(first)
    if nodes is None:
        speed = float(np.abs(np.linalg.eigvals(first)).max(initial=1.0))
        nodes = int(np.clip(12 + 0.6 * speed * delay, 12, max(14, 700 // size)))
    generator = np.zeros((size * (nodes + 1), size * (nodes + 1)))
    D = _differentiation(nodes) * 2.0 / delay
    generator[size:] = np.kron(D[1:], np.eye(size))
    generator[:size, :size] = first
    generator[:size, -size:] = second
    found = np.linalg.eigvals(generator)
    found = found[np.argsort(-found.real)][: max(4 * size, 20)]
    refined = [_newton(first, second, root, delay=delay) for root in found]
    good = np.array([root for root in refined if root is not None], dtype=complex)
    return good[np.argsort(-good.real)]


def _differentiation(degree: int) -> Array:
    """Chebyshev differentiation matrix on points that fall from 1 to −1."""
    k = np.arange(degree + 1)
    x = np.cos(np.pi * k / degree)
    c = np.where((k == 0) | (k == degree), 2.0, 1.0) * (-1.0) ** k
    gap = x[:, None] - x[None, :]
    D = np.outer(c, 1.0 / c) / (gap + np.eye(degree + 1))
    return D - np.diag(D.sum(axis=1))


def _newton(A_0: Array, A_1: Array, root: complex, *, delay: float) -> complex | None:
    """Correct one root with its eigenvector; None if it does not settle where it began."""
    size, start = len(A_0), root
    scale = np.linalg.norm(A_0) + np.linalg.norm(A_1)
    matrix = _characteristic(A_0, A_1, root, delay=delay)
    vector = np.linalg.svd(matrix)[2][-1].conj()
    border = vector.conj()
    for _ in range(12):
        matrix = _characteristic(A_0, A_1, root, delay=delay)
        slope = np.eye(size) + delay * np.exp(-root * delay) * A_1
        system = np.block(
            [[matrix, (slope @ vector)[:, None]], [border[None, :], np.zeros((1, 1))]]
        )
        right = -np.concatenate([matrix @ vector, [border @ vector - 1.0]])
        try:
            step = np.linalg.solve(system, right)
        except np.linalg.LinAlgError:
            break
        vector, root = vector + step[:-1], root + step[-1]
        if not np.isfinite(root) or abs(root - start) > 0.2 * (abs(start) + 1.0 / delay):
            return None
        if abs(step[-1]) <= 1e-12 * (abs(root) + 1e-6 * scale):
            return root
    residual = np.linalg.norm(_characteristic(A_0, A_1, root, delay=delay) @ vector)
    return root if residual <= 1e-8 * scale * np.linalg.norm(vector) else None


def _characteristic(A_0: Array, A_1: Array, root: complex, *, delay: float) -> Array:
    return root * np.eye(len(A_0)) - A_0 - np.exp(-root * delay) * A_1
