"""Law and links of a frozen loop without conserved momentum, and without noise for stiffness."""

from dataclasses import dataclass, replace

import numpy as np

from sealag.typing import Array
from sealag.whole_body._links import FreeLinks, norm, null_space
from sealag.whole_body._signal_states import LawDerivative

_FELT = 1e-6
"""Share of the law's stiffness from which it counts as feeling a motion of the whole robot. Central
differences leave 1e-9 where it feels none; a task that feels one feels it with its whole gain."""

_KNOWN = 1e-9
"""Share of the law's and the links' stiffness that central differences leave open: a motion that is
held by less is held by nothing."""

_INTEGRATES = 1e12
"""Condition from which memory counts as one that integrates: it has no settled command."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Memory ξ of a law, in coordinates z of the links: C ξ of the command, and

        ξ̇ = A ξ + B_z z + B_theta θ + B_z_rate ż + B_rate θ̇ .

    Attributes:
        A: (s, s) 1/s.
        B_z: (s, k).
        B_theta: (s, n).
        B_z_rate: (s, k).
        B_rate: (s, n).
        C: (n, s).
        period: s, that it is the bilinear equivalent for; 0 if it goes on in continuous time.
        held: whether it moves at the controller's ticks, with its measurement held in between.
    """

    A: Array
    B_z: Array
    B_theta: Array
    B_z_rate: Array
    B_rate: Array
    C: Array
    period: float = 0.0
    held: bool = False


def without_momentum(
    links: FreeLinks, command: LawDerivative
) -> tuple[FreeLinks, Array, Array, Array]:
    """Split off rigid motions: those that the law does not feel are symmetries; of those that it
    feels the conserved momentum is left out, z are motions without it, rᵀ M z = 0.

    No delay moves the zero roots of what is conserved.

    Returns:
        Links, symmetries (k, s), and the command's and the memory's columns of z.
    """
    rigid, M = links.rigid, links.M
    felt_by = np.vstack([command.C_q, command.B_q]) @ links.Z
    size = max(norm(felt_by), norm(command.C_theta)) * _FELT / 1e-9
    kept = rigid @ null_space(felt_by @ rigid, rigid.shape[1], size=size)
    felt_by = felt_by @ (np.eye(len(M)) - kept @ np.linalg.pinv(kept))
    felt = rigid @ null_space(kept.T @ M @ rigid, rigid.shape[1], size=norm(M))
    Y = null_space(felt.T @ M, len(M), size=norm(M))
    links = replace(links, Z=links.Z @ Y, M=Y.T @ M @ Y, H=Y.T @ links.H @ Y, rigid=Y.T @ rigid)
    felt_by = felt_by @ Y
    n = len(command.C_q)
    return links, Y.T @ kept, felt_by[:n], felt_by[n:]


def without_noise(
    H: Array, S: Array, K: Array, *, C_z: Array, C_theta: Array, memory: Memory
) -> tuple[Array, Array, Array]:
    """Leave nothing of the stiffness along motions that it holds by no more than differences err.

    A joint whose gravity is compensated and that no task holds rests wherever it is. Its root is 0,
    which rounding of the differences must not push to the left. H z = Sᵀ K (θ − S z) and
    K (θ − S z) = C_z z + C_theta θ then hold exactly along it.

    Returns:
        H, C_z and C_theta.
    """
    k, springs = S.shape[1], np.diag(K)
    settled = np.hstack([C_z, C_theta])
    if len(memory.A) and np.linalg.cond(memory.A) < _INTEGRATES:
        settled = settled - memory.C @ np.linalg.solve(
            memory.A, np.hstack([memory.B_z, memory.B_theta])
        )
    stretch = springs @ np.hstack([-S, np.eye(len(K))])
    static = np.vstack([np.hstack([H, np.zeros_like(S.T)]) - S.T @ stretch, stretch - settled])
    _, values, rows = np.linalg.svd(static)
    loose = rows[values <= _KNOWN * (norm(H) + norm(settled))].T
    left = static @ loose
    command = left[k:] @ loose.T
    z = np.linalg.pinv(loose[:k])
    links = left[:k] @ z
    links = links + links.T - z.T @ (loose[:k].T @ links)
    return H - links, C_z + command[:, :k], C_theta + command[:, k:]
