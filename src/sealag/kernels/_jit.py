"""How kernels are compiled.

An `entry` is called from Python and cached with all that it calls. An `inner` kernel exists only
inside entries: it is inlined there, and neither optimised nor translated on its own, which would
take most of the compilation. It counts no references, for that costs more than its arithmetic, and
so it can neither allocate nor return new arrays: memory comes from Python, see `keep`.
"""

import warnings
from typing import Any

from numba import njit, types
from numba.core import config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering
from numba.experimental import structref

from sealag.errors import InputError

if config.DISABLE_JIT:
    raise InputError("NUMBA_DISABLE_JIT is set, and sealag's kernels are compiled: unset it.")


class _NoEnvironments:
    """Stands for the code generator of kernels that no Python function calls."""

    def set_env(self, name: str, environment: Any) -> None:
        """There is no machine code that would look for it."""


class _InlinedLibrary(JITCodeLibrary):
    """Code that is linked into others: neither optimised nor translated on its own."""

    @property
    def codegen(self) -> Any:
        return _NoEnvironments()

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: no machine code of that name exists."""
        self._ensure_finalized()
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _InlinedLowering(NativeLowering):
    """Numba's own lowering, into an `_InlinedLibrary`."""

    _name = "inlined_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _InlinedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return NativeLowering.run_pass(self, state)


class _Inlined(CompilerBase):
    """Numba's compiler with `_InlinedLowering`."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_InlinedLowering if step is NativeLowering else step, why)
            for step, why in passes.passes
        ]
        passes.finalize()
        return [passes]


_INNER: dict[str, Any] = {
    "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": _Inlined, "_nrt": False,
}  # fmt: skip


def _kept_on_disk() -> bool:
    """Whether Numba finds a folder for its cache; says so once if it does not."""
    try:
        njit(cache=True)(_kept_on_disk)
    except RuntimeError:
        warnings.warn(
            "sealag's kernels cannot be kept: no folder for Numba's cache can be written, so that "
            "they are compiled anew in each process, for minutes; set NUMBA_CACHE_DIR to one",
            RuntimeWarning,
            stacklevel=2,
        )
        return False
    return True


KEPT_ON_DISK = _kept_on_disk()
"""Whether a kernel that is compiled is there for the next process."""

_ENTRY: dict[str, Any] = {"cache": KEPT_ON_DISK, "no_cfunc_wrapper": True}

entry = njit(**_ENTRY)
"""Called from Python, and kept on disk with all that it calls."""

inner = njit(forceinline=True, **_INNER)
"""Called by kernels only; reads and writes arrays that it is given."""

shared = njit(**_INNER)
"""A large inner kernel that several places call: one copy, instead of one at each place."""

summing = njit(forceinline=True, fastmath={"reassoc", "contract"}, **_INNER)
"""An inner kernel whose sums may be regrouped, so that the processor adds several terms at once."""


@structref.register
class _KeptType(types.StructRef):
    """Numba's type of `Kept`."""


class Kept(structref.StructRefProxy):
    """Named parts as kernels read them: handed over once, by `keep`, instead of at every call."""


structref.define_proxy(Kept, _KeptType, ["parts"])

# Numba's own is a Python property, which a signal's handler may interrupt inside a compiled call.
Kept._numba_type_ = vars(structref.StructRefProxy)["_type"]


@entry
def keep(parts):
    """Return a NamedTuple of arrays, numbers and such NamedTuples for kernels; arrays stay live."""
    return Kept(parts)
