"""Digests change with code and attributes, and with nothing else."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from layoutexplore.plugins.code_digest import digest_of

CELL = """
LIMIT = 3
def helper(x): return x + LIMIT
class Base:
    weight = 1
    def act(self, x): return helper(x)
class Agent(Base):
    def __init__(self, size=1): self.size = size
    def reset(self, seed): self.seen = {'b', 'a'}
"""


def defined(text: str, name: str = "Agent") -> Any:
    """What a cell of a notebook defines: without a file."""
    module = ModuleType("__main__")
    exec(compile(text, "<cell>", "exec"), vars(module))
    return vars(module)[name]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("x + LIMIT", "x - LIMIT"),
        ("LIMIT = 3", "LIMIT = 4"),
        ("weight = 1", "weight = 2"),
        ("return helper(x)", "return helper(x) + 1"),
        ("size=1", "size=2"),
        ("{'b', 'a'}", "{'b', 'c'}"),
    ],
)
def test_every_change_of_a_cell_counts(old: str, new: str) -> None:
    assert digest_of(defined(CELL)) == digest_of(defined(CELL))
    assert digest_of(defined(CELL)) != digest_of(defined(CELL.replace(old, new)))


def test_attributes_of_an_object_count() -> None:
    kind = defined(CELL)
    assert digest_of(kind(2)) == digest_of(kind(2)) != digest_of(kind(3)) != digest_of(kind)
    array = np.zeros(3)
    assert digest_of(kind(array)) == digest_of(kind(array.copy())) != digest_of(kind(array + 1))


def test_other_sessions_find_the_same() -> None:
    code = (
        f"text = {CELL!r}\nexec(compile(text, '<cell>', 'exec'))\n"
        "from layoutexplore.plugins.code_digest import digest_of\n"
        "print(digest_of(Agent({'x', 'y', 'z'})))"
    )
    found = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    }
    assert len(found) == 1
