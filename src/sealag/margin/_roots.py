"""Rightmost characteristic roots, by Chebyshev collocation and Newton's method."""

import numpy as np

from sealag.margin._loop import EPS, Loop
from sealag.typing import Array

_MOST_NODES = 120


def loop_roots(loop: Loop, delay: float, *, count: int, nodes: int = 24) -> Array:
    """Rightmost roots of a prepared loop.

    Args:
        loop: the loop.
        delay: d, s.
        count: how many.
        nodes: Chebyshev nodes to begin with.

    Returns:
        (count,) roots by decreasing real part.
    """
    if not _pieces(loop, delay):
        values = np.linalg.eigvals(loop.A_0 + loop.A_1 + loop.A_e)
        return values[np.argsort(-values.real)][:count]
    longest = max(_pieces(loop, delay))
    previous = _collocated(loop, delay, count=count, nodes=nodes)
    while nodes < _MOST_NODES:
        nodes = 3 * nodes // 2
        roots = _collocated(loop, delay, count=count, nodes=nodes)
        moved = np.abs(roots.real - previous.real).max()
        if moved <= 1e-8 * max(1.0 / longest, float(np.abs(roots).max())):
            break
        previous = roots
    return roots


def _pieces(loop: Loop, delay: float) -> list[float]:
    """The delays in increasing order, each once, zero left out."""
    late = [delay] if loop.B.size else []
    return sorted({age for age in (*late, loop.embedded_delay) if age > 0.0})


def _collocated(loop: Loop, delay: float, *, count: int, nodes: int) -> Array:
    n = len(loop.A_0)
    ages = _pieces(loop, delay)
    starts = [0.0, *ages[:-1]]
    D = np.zeros((len(ages) * nodes + 1,) * 2)
    for piece, (start, end) in enumerate(zip(starts, ages, strict=True)):
        at = slice(piece * nodes, (piece + 1) * nodes + 1)
        D[at, at][1:] = 2.0 / (end - start) * _differentiation(nodes)[1:]
    signals = _late_signals(loop)
    k = len(signals)
    past = slice(n, n + k * (len(D) - 1))
    generator = np.zeros((past.stop, past.stop))
    generator[:n, :n] = loop.A_0
    generator[past, :n] = np.kron(D[1:, :1], signals)
    generator[past, past] = np.kron(D[1:, 1:], np.eye(k))
    for part, age in ((loop.A_1, delay), (loop.A_e, loop.embedded_delay)):
        if age in ages:
            last = n + k * (ages.index(age) + 1) * nodes
            generator[:n, last - k : last] += part @ signals.T
        else:
            generator[:n, :n] += part
    values = np.linalg.eigvals(generator)
    values = values[np.argsort(-values.real)][: 2 * count + 4]
    refined = np.array([_newton(loop, delay, value) for value in values])
    order = np.argsort(-refined.real, kind="stable")
    return refined[order][:count]


def _late_signals(loop: Loop) -> Array:
    """(k, n) orthonormal rows E with A_1 = A_1 Eᵀ E and A_e = A_e Eᵀ E: what is felt late."""
    _, sizes, rows = np.linalg.svd(np.vstack([loop.C, loop.A_e]))
    return rows[: int((sizes > EPS * sizes[0]).sum())]


def _differentiation(N: int) -> Array:
    """(N+1, N+1) Chebyshev differentiation on cos(kπ/N): the first node is the present."""
    x = np.cos(np.pi * np.arange(N + 1) / N)
    weight = np.where((np.arange(N + 1) == 0) | (np.arange(N + 1) == N), 2.0, 1.0)
    weight = weight * (-1.0) ** np.arange(N + 1)
    D = np.outer(weight, 1.0 / weight) / (x[:, None] - x[None, :] + np.eye(N + 1))
    return D - np.diag(D.sum(axis=1))


def _newton(loop: Loop, delay: float, root: complex) -> complex:
    """Newton on the smallest singular direction; the start where it does not converge."""
    start, longest = root, max(_pieces(loop, delay))
    for _ in range(12):
        factor = np.exp(-root * delay)
        P, rate = loop.characteristic(root, factor)
        U, values, V = np.linalg.svd(P)
        left, right = U[:, -1].conj(), V[-1].conj()
        slope = left @ (rate + delay * factor * loop.A_1) @ right
        if slope == 0.0:
            break
        step = values[-1] / slope
        root = root - step
        if abs(root - start) > 0.1 * max(abs(start), 1.0 / longest):
            return start
        if abs(step) <= 1e-14 * max(abs(root), 1e-300):
            break
    return root
