"""Kernels that come from numba's cache, without the time and the memory of what only compiling needs."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import binding
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

_SECTION = np.dtype("<u4, <u4, <u8, <u8, <u8, <u8, <u4, <u4, <u8, <u8")
_SYMBOL = np.dtype("<u4, u1, u1, <u2, <u8, <u8")
"""What an ELF file (of 64 bits) says of a section, and of a symbol."""


class LeanLibrary(JITCodeLibrary):
    """The code of a kernel, whose bitcode is parsed when a new kernel that calls it is compiled.

    The cache holds machine code, which is all that a call needs, and bitcode, into which other kernels are
    compiled. Numba parses the latter at once, which takes most of the time of loading, and keeps it: ten
    times its size, 0.4 MB a kernel.
    """

    _bitcode = b""
    _parsed: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, code = state
        known = hasattr(getattr(codegen, "_engine", None), "_defined_symbols")  # of this numba
        names = defined_names(code[0]) if kind == "object" and known else None
        if names is None:
            library = super()._unserialize(codegen, state)  # type: ignore[no-untyped-call]
            if kind == "object":
                library._bitcode, library._parsed = code[1], None
            return library
        library = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(code[0])
        library._bitcode = code[1]
        library._finalize_final_module()
        codegen._engine._defined_symbols |= names
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


def defined_names(code: bytes) -> set[str] | None:
    """Names of the functions and variables in machine code; None where it is no ELF file of 64 bits."""
    if code[:6] != b"\x7fELF\2\1":
        return None
    start, count = np.frombuffer(code, "<u8", 1, 0x28)[0], np.frombuffer(code, "<u2", 1, 0x3C)[0]
    sections = np.frombuffer(code, _SECTION, count, start)
    names: set[str] = set()
    for _, kind, _, _, begin, size, link, *_ in sections.tolist():
        if kind == 2:  # the table of symbols; those of no section are defined elsewhere
            symbols = np.frombuffer(code, _SYMBOL, size // _SYMBOL.itemsize, begin)
            text = sections[link][4]
            places = (symbols["f0"][symbols["f3"] != 0] + text).tolist()
            names |= {code[at : code.index(b"\0", at)].decode() for at in places}
    return names


def keep_kernels_lean() -> None:
    """Load kernels as `LeanLibrary` from now on; a numba that is built otherwise stays as it is."""
    if getattr(JITCPUCodegen, "_library_class", None) is JITCodeLibrary:
        JITCPUCodegen._library_class = LeanLibrary
