"""Kernels from the cache keep their machine code alone, and new kernels can still be compiled with them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from llvmlite import binding
from numba.core.codegen import JITCodeLibrary

from layoutexplore.processes.kernel_memory import LeanLibrary, defined_names

KERNEL = """
import sys
from numba import njit
import layoutexplore.grids
from layoutexplore.processes.kernel_memory import LeanLibrary

@njit(cache=True)
def first(x): return x + 1

library = first.overloads[first.compile("int64(int64)") and first.signatures[0]].library
print(type(library) is LeanLibrary, library._parsed is None, first(1))

@njit
def second(x): return first(x) * 2

print(second(2), library._parsed is not None)
"""


def test_bitcode_is_parsed_when_a_new_kernel_needs_it(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    said = []
    for _ in range(2):
        words = [sys.executable, str(tmp_path / "kernel.py")]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
        said.append(done.stdout.split())
    assert said[0][0] == "True" and said[0][2:] == ["2", "6", "True"]
    assert said[1] == ["True", "True", "2", "6", "True"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="ELF is the format of Linux")
def test_what_machine_code_defines_is_known_without_its_bitcode() -> None:
    module = binding.parse_assembly("""
        @kept = global i64 0
        @theirs = external global i64
        declare i64 @elsewhere(i64)
        define weak i64 @asks(i64 %x) {
            %there = load i64, i64* @theirs
            %y = call i64 @elsewhere(i64 %there)
            ret i64 %y
        }
    """)
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine()
    code = machine.emit_object(module)
    found = defined_names(code)
    assert found is not None and {"kept", "asks"} <= found and not {"theirs", "elsewhere"} & found
    assert defined_names(b"MZ" + code[2:]) is None


def test_a_numba_that_keeps_symbols_elsewhere_parses_bitcode(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def parse(codegen: object, state: object) -> SimpleNamespace:
        asked.append(state)
        return SimpleNamespace()

    monkeypatch.setattr(JITCodeLibrary, "_unserialize", parse)
    state = "kernel", "object", (b"\x7fELF\2\1", b"bitcode")
    library = LeanLibrary._unserialize(SimpleNamespace(), state)
    assert asked == [state] and library._bitcode == b"bitcode"
