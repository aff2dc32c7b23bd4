"""Array aliases. A name says what an array is; docstrings say its shape.

They are named types: `help` and `inspect.signature` show their names and not NumPy's unions.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeAliasType

Array = TypeAliasType("Array", npt.NDArray[Any])
"""Array of doubles; NumPy's own annotations are too wide for `NDArray[np.float64]`."""

ArrayLike = TypeAliasType("ArrayLike", npt.ArrayLike)
"""What NumPy makes an array of: an array, a number or lists of numbers."""

IntArray = TypeAliasType("IntArray", npt.NDArray[np.int64])
"""Array of 64-bit integers."""

BoolArray = TypeAliasType("BoolArray", npt.NDArray[np.bool_])
"""Array of truth values."""

__all__ = ["Array", "ArrayLike", "BoolArray", "IntArray"]
