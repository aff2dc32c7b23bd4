"""Task errors: placements of frames, and what lower tasks leave to higher ones."""

import numpy as np

from sealag.kernels._jit import entry, inner


@entry
def leave_to_higher(J_t, lift, levels, error, motion):
    """Take out of each task's error what the tasks above it will remove, in place.

    x̃_{k|prec} = x̃_k − J_k Σ_{i<k} P_i J_iᵀ Λ_i x̃_{i|prec}. Where J̇ = 0 its rate is
    −J*_{k|prec} q̇_j, so that J*_{k|prec}ᵀ S_k x̃_{k|prec} is the gradient of ½ x̃ᵀ S x̃.

    Args:
        J_t: (m, nv) task Jacobians.
        lift: (m, nv) of the `Space`.
        levels: (k + 1,) first row of each level, then m.
        error: (m,), overwritten.
        motion: (nv,) scratch.
    """
    nv = J_t.shape[1]
    motion[:] = 0.0
    for k in range(len(levels) - 1):
        for r in range(levels[k], levels[k + 1]):
            for i in range(nv):
                error[r] -= J_t[r, i] * motion[i]
        for r in range(levels[k], levels[k + 1]):
            for i in range(nv):
                motion[i] += lift[r, i] * error[r]


@inner
def frame_error(R_wanted, p_wanted, R, p, out):
    """Position and rotation that lead from a frame's placement to the wanted one, world axes.

    Args:
        R_wanted: (3, 3).
        p_wanted: (3,).
        R: (3, 3).
        p: (3,).
        out: (6,) p_wanted − p, then the rotation vector of R_wanted Rᵀ, of length 0 … π.
    """
    out[:3] = 0.0
    trace = 0.0
    for k in range(3):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            out[i] += 0.5 * (R_wanted[b, k] * R[a, k] - R_wanted[a, k] * R[b, k])
            trace += R_wanted[i, k] * R[i, k]
    sine = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    cosine = 0.5 * (trace - 1.0)
    angle = np.arctan2(sine, cosine)
    if cosine > -0.99:
        scale = angle / sine if sine > 1e-9 else 1.0
        for i in range(3):
            out[3 + i] = scale * out[i]
    else:
        _turn_about(R_wanted, R, cosine, angle, out)
    for i in range(3):
        out[i] = p_wanted[i] - p[i]


@inner
def _turn_about(R_wanted, R, cosine, angle, out):
    """out[3:] = angle · axis near half a turn, from E + Eᵀ = 2 cos I + 2 (1 − cos) a aᵀ.

    out[:3] holds sin · a, which tells a from −a.
    """
    best, column = -1.0, 0
    for j in range(3):
        diagonal = 0.0
        for k in range(3):
            diagonal += R_wanted[j, k] * R[j, k]
        if diagonal > best:
            best, column = diagonal, j
    length, side = 0.0, 0.0
    for i in range(3):
        entry = 0.0
        for k in range(3):
            entry += 0.5 * (R_wanted[i, k] * R[column, k] + R_wanted[column, k] * R[i, k])
        out[3 + i] = entry - cosine if i == column else entry
        length += out[3 + i] * out[3 + i]
        side += out[3 + i] * out[i]
    scale = (angle if side >= 0.0 else -angle) / np.sqrt(length)
    for i in range(3):
        out[3 + i] *= scale
