"""Array aliases. A name says what an array is; docstrings say its shape."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[Any]
"""Array of doubles; NumPy's own annotations are too wide for `NDArray[np.float64]`."""

IntArray: TypeAlias = NDArray[np.int64]
"""Array of 64-bit integers."""

BoolArray: TypeAlias = NDArray[np.bool_]
"""Array of truth values."""

__all__ = ["Array", "ArrayLike", "BoolArray", "IntArray"]
