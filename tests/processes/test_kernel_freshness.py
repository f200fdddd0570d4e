"""Kernels in the cache that others have been compiled into."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import layoutexplore.grids  # noqa: F401  (changes how kernels are kept)
from layoutexplore.cli.warm_up import warm_up_steps
from layoutexplore.processes.kernel_freshness import taken_in
from layoutexplore.processes.kernel_list import listed_kernels, resolved

FILES = {
    "fresh_numbers": """
import numpy as np
STEP, TABLE = 1, np.array([10, 20])
""",
    "fresh_inner": """
from numba import njit
from fresh_numbers import STEP
@njit(cache=True)
def inner(x):
    return x + STEP
""",
    "fresh_outer": """
from numba import njit
from fresh_inner import inner
from fresh_numbers import TABLE
@njit(cache=True)
def outer(x):
    return inner(x) + TABLE[0]
""",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where the three files are; Python keeps nothing of them."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for name, text in FILES.items():
        (tmp_path / f"{name}.py").write_text(text)
    yield tmp_path
    for name in FILES:
        sys.modules.pop(name, None)


def anew() -> ModuleType:
    """The outer module, as in a new process."""
    for name in FILES:
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    return importlib.import_module("fresh_outer")


def hits(module: ModuleType) -> int:
    return sum(module.outer.stats.cache_hits.values())


@pytest.mark.parametrize(
    ("name", "old", "new", "result"),
    [
        ("fresh_inner", "x + STEP", "x - STEP", 14),
        ("fresh_numbers", "STEP, TABLE = 1", "STEP, TABLE = 7", 22),
        ("fresh_numbers", "[10, 20]", "[30, 20]", 36),
    ],
)
def test_a_kernel_follows_what_it_has_taken_in_from_other_files(
    folder: Path, name: str, old: str, new: str, result: int
) -> None:
    assert (anew().outer(5), hits(module := anew()), module.outer(5), hits(module)) == (16, 0, 16, 1)
    file = folder / f"{name}.py"
    file.write_text(file.read_text().replace(old, new))
    assert ((module := anew()).outer(5), hits(module)) == (result, 0)
    assert ((module := anew()).outer(5), hits(module)) == (result, 1)


def test_what_changes_nothing_in_it_leaves_a_kernel_in_the_cache(folder: Path) -> None:
    anew().outer(5)
    for name in ("fresh_inner", "fresh_numbers"):
        file = folder / f"{name}.py"
        file.write_text(f"# A remark.\n{file.read_text()}OTHER = 3\n")
    module = anew()
    assert (module.outer(5), hits(module)) == (16, 1)


def test_globals_that_cannot_be_told_stop_no_kernel(folder: Path) -> None:
    """A program's own: an attribute may be called as one of them, so that it is looked at in vain."""
    outer = folder / "fresh_outer.py"
    odd = "class Odd:\n    __class__ = property(lambda self: 1 / 0)\nreal, size = Odd(), np.array([{}])\n"
    text = FILES["fresh_outer"].replace("inner(x)", "inner(x).real + TABLE.size - 2")
    outer.write_text(f"import numpy as np\n{text}{odd}")
    for found in (0, 1):
        module = anew()
        assert (module.outer(5), hits(module)) == (16, found)


def test_what_was_kept_of_a_kernel_as_it_was_is_removed(folder: Path) -> None:
    """As long as it may be of a process that is about to say what it has written, it stays."""
    outer = folder / "fresh_outer.py"
    outer.write_text(f"__name__ = 'layoutexplore.fresh_outer'\n{FILES['fresh_outer']}")  # ours alone
    anew().outer(5)
    (kept,) = folder.rglob("fresh_outer.*.nbi")
    others = [
        kept.with_name(kept.name.replace("outer.outer-", f"outer.{name}")) for name in ("outer-9", "other-")
    ]
    young, *old = (path.with_suffix(f".{k}.nbc") for k, path in enumerate((kept, kept, others[0])))
    for path in (young, *old, *others):
        path.write_bytes(b"")
        if path != young:
            os.utime(path, (0, 0))
    inner = folder / "fresh_inner.py"
    inner.write_text(inner.read_text().replace("x + STEP", "x - STEP"))
    assert (anew().outer(5), hits(module := anew()), module.outer(5), hits(module)) == (14, 0, 14, 1)
    assert [path.exists() for path in (kept, young, others[1])] == [True, True, True]
    assert [path.name for path in (*old, others[0]) if path.exists()] == []


def test_another_process_finds_the_kernels_of_this_one() -> None:
    """Their digests hold no addresses, and nothing whose order a process draws by chance."""
    digests = (
        "from layoutexplore.cli.warm_up import warm_up_steps\n"
        "from layoutexplore.processes.kernel_freshness import taken_in\n"
        "from layoutexplore.processes.kernel_list import listed_kernels, resolved\n"
        "for kernel in listed_kernels(name for name, _ in warm_up_steps()):\n"
        "    print(taken_in(resolved(kernel)[0].py_func))\n"
    )
    there = subprocess.run(
        [sys.executable, "-c", digests],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONHASHSEED": "7"},
    ).stdout.split()
    here = [taken_in(resolved(k)[0].py_func) for k in listed_kernels(name for name, _ in warm_up_steps())]
    assert there == here and len(set(here)) > 300
