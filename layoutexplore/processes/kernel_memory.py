"""Kernels that come from numba's cache, without the memory of what only compiling needs."""

from __future__ import annotations

from typing import Any

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen


class LeanLibrary(JITCodeLibrary):
    """The code of a kernel, whose bitcode is parsed when a new kernel that calls it is compiled.

    The cache holds machine code, which is all that a call needs, and bitcode, into which other kernels are
    compiled. Numba parses the latter at once and keeps it: ten times its size, 0.4 MB a kernel.
    """

    _bitcode = b""
    _parsed: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        library = super()._unserialize(codegen, state)  # type: ignore[no-untyped-call]
        _, kind, code = state
        if kind == "object":
            library._bitcode, library._parsed = code[1], None
        return library

    @property
    def _shared_module(self) -> Any:
        """The parsed bitcode, by numba's name; None while there is none."""
        if self._parsed is None and self._bitcode:
            self._parsed = binding.parse_bitcode(self._bitcode)
        return self._parsed

    @_shared_module.setter
    def _shared_module(self, module: Any) -> None:
        self._parsed = module


def keep_kernels_lean() -> None:
    """Load kernels as `LeanLibrary` from now on; a numba that is built otherwise stays as it is."""
    if getattr(JITCPUCodegen, "_library_class", None) is JITCodeLibrary:
        JITCPUCodegen._library_class = LeanLibrary
