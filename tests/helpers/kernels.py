"""Kernels that only kernels call, made callable from Python, and the values that they take."""

import numpy as np
from numba import njit

from sealag.kernels import control_law, operational_space


def from_python(kernel):
    """Return a kernel with what Python needs to call it."""
    return njit(kernel.py_func)


solve_space = from_python(operational_space.operational_space)


def space_of(nv, n, c, *, m):
    """Return the arrays of one operational space."""
    return operational_space.allocate(nv, n, c, m=m)


def newton_of(nv, n, m, *, slope=None, J=None):
    """Return memory for q̄(θ), with ∂ḡ/∂q_j (n, n) and the errors' Jacobian (m, n) filled in."""
    return control_law.Newton(
        H=np.zeros((nv, nv)), moved=np.zeros((nv, n)),
        slope=np.zeros((n, n)) if slope is None else np.array(slope, dtype=float),
        J=np.zeros((m, n)) if J is None else np.ascontiguousarray(J), force=np.zeros((m, n)),
        square=np.zeros((n, n)), step=np.zeros(n),
    )  # fmt: skip
