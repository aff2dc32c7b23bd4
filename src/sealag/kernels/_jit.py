"""How kernels are compiled."""

from typing import Any

from numba import njit

_WITHOUT: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

entry = njit(cache=True)
"""Called from Python, and kept on disk with all that it calls."""

inner = njit(**_WITHOUT)
"""Called by kernels only: without what Python needs to call it, half of its compilation."""
