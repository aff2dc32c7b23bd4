"""Compiled kernels: `@njit` functions over arrays, nothing else.

Each kernel has a slow twin in plain NumPy under ``tests/reference``. Importing this package
compiles nothing; ``python -m sealag.kernels`` compiles and caches every kernel.
"""
