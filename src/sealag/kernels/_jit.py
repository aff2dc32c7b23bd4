"""How kernels are compiled."""

from numba import njit

entry = njit(cache=True)
"""Called from Python, and kept on disk with all that it calls."""

inner = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Called by kernels only: without what Python needs to call it, half of its compilation."""
