"""Compile and cache every kernel, so that no user waits for the compiler at a first command."""

import sys

from sealag.kernels import compile_all

if __name__ == "__main__":
    compile_all(lambda name: print(f"  kernels/{name}", file=sys.stderr))
