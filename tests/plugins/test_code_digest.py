"""Digests change with code and attributes, and with nothing else."""

from __future__ import annotations

import copy
import logging
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from layoutexplore.plugins.code_digest import digest_of
from tests.plugins.cases import write

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


def defined(text: str, name: str = "Agent", place: str = "<cell>") -> Any:
    """What a cell of a notebook defines: without a file; or a program in one."""
    module = ModuleType("__main__")
    exec(compile(text, place, "exec"), vars(module))
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


BEHIND = """
import enum
import functools
import numpy as np
TABLE = {'a': 1, 'b': {'x', 'y', 'z'}, 'c': frozenset({('p', 1), ('q', 2)})}
LIST = [1, 'two', object()]
ARRAY = np.arange(4)
class Mode(enum.Enum):
    FAST = 1
    SLOW = {'x': 2}
    def faster(self): return self is Mode.FAST
MODES = {Mode.FAST, Mode.SLOW}
@functools.lru_cache
def cached(x): return x + 1
def plus(x, y): return x + y
half = functools.partial(plus, y=2)
def logged(prefix):
    def around(function):
        @functools.wraps(function)
        def inner(*values): return prefix, function(*values)
        return inner
    return around
@logged('log')
def wrapped(x): return x * 2
def scaled(factor): return lambda x: x * factor
near, far = scaled(3), scaled(5)
class Point:
    __slots__ = ('x',)
    def __init__(self, x): self.x = x
POINT = Point(5)
class Base:
    @functools.cached_property
    def slow(self): return 6
    @functools.lru_cache(maxsize=4)
    def kept(self): return self.slow
class Agent(Base):
    limits = {'near': 1}
    half = functools.partialmethod(plus, y=7)
    @staticmethod
    @functools.lru_cache
    def fixed(x): return x - 1
    def act(self, x):
        known = [TABLE, LIST, ARRAY, MODES, POINT, self]
        return known, cached(x), half(x), wrapped(x), near(x), far(x)
"""
CHANGES = [
    ("'a': 1", "'a': 2"),
    ("'x', 'y', 'z'", "'x', 'y'"),
    ("('q', 2)", "('q', 3)"),
    ("'two'", "'too'"),
    ("np.arange(4)", "np.arange(4) % 3"),
    ("np.arange(4)", "np.arange(4.0)"),
    ("FAST = 1", "FAST = 3"),
    ("{'x': 2}", "{'x': 3}"),
    ("self is Mode.FAST", "self is Mode.SLOW"),
    ("return x + 1", "return x + 2"),
    ("return x + y", "return x - y"),
    ("plus, y=2", "plus, y=3"),
    ("prefix, function", "function, prefix"),
    ("'log'", "'lag'"),
    ("return x * 2", "return x * 3"),
    ("x * factor", "x / factor"),
    ("scaled(3), scaled(5)", "scaled(5), scaled(3)"),
    ("self.x = x", "self.x = -x"),
    ("Point(5)", "Point(6)"),
    ("return 6", "return 7"),
    ("return self.slow", "return -self.slow"),
    ("'near': 1", "'near': 2"),
    ("y=7", "y=8"),
    ("return x - 1", "return x - 2"),
]


@pytest.mark.parametrize(("old", "new"), CHANGES)
@pytest.mark.parametrize("in_file", [False, True])
def test_what_stands_behind_a_name_counts(tmp_path: Path, old: str, new: str, in_file: bool) -> None:
    changed = BEHIND.replace(old, new)
    assert changed != BEHIND
    first, second = (
        digest_of(defined(text, place=write(tmp_path, text, f"{name}.py") if in_file else "<cell>"))
        for name, text in (("first", BEHIND), ("second", changed))
    )
    assert first != second


def test_what_is_not_looked_up_does_not_count() -> None:
    beside = BEHIND + "OTHER = {1}\nlater = OTHER\n"
    assert digest_of(defined(beside)) == digest_of(defined(BEHIND))


def test_what_an_object_keeps_for_later_does_not_count() -> None:
    kind = defined(BEHIND)
    one, other = kind(), kind()
    assert one.slow == 6 and vars(one) and not vars(other)
    assert digest_of(one) == digest_of(other)


def test_what_python_keeps_in_a_class_when_an_object_is_copied_does_not_count() -> None:
    kind = defined(CELL)
    before = digest_of(kind)
    copy.copy(kind())
    assert digest_of(kind) == before == digest_of(defined(CELL))


def test_code_has_a_digest_whose_file_is_no_python_any_more(tmp_path: Path) -> None:
    """As a program that is edited while it runs, or a page of which code is run."""
    for text in ("it's said: 'x", 'a = """b', "a = (b", "a = 'b\\", "  a\n b", "}", ""):
        program = write(tmp_path, "\n".join(12 * [text]))
        assert len(digest_of(defined(CELL, place=program))) == 12


def test_odd_things_have_digests() -> None:
    """What reaches itself, is too deep, or cannot be pickled."""
    ring: list[Any] = [1]
    ring.append(ring)
    deep: list[Any] = []
    for _ in range(5000):
        deep = [deep]
    kind = defined(CELL)
    for value in (ring, deep, (i for i in ()), threading.Lock(), Mock(), 10**5000, re.compile("a"), np.add):
        assert digest_of(kind(value)) == digest_of(kind(value))
    assert digest_of(kind(re.compile("a"))) != digest_of(kind(re.compile("b")))


HELPERS = {
    "beside_values.py": "TABLE = {'a': 1}\ndef score(x): return x",
    "beside_module.py": "SIZE = 1",
    "beside_late.py": "from beside_deep import SIZE",
    "beside_deep.py": "SIZE = 1",
    "beside_package/__init__.py": "",
    "beside_package/part.py": "SIZE = 1",
}
PROGRAM = (
    BEHIND.replace(
        "return known", "import beside_late\n        from beside_package import part\n        return known"
    )
    .replace("[TABLE, LIST", "[score, beside_module.SIZE, TABLE, LIST")
    .replace("import enum", "import enum, beside_module\nfrom beside_values import score")
)
PROGRAM += (
    "from layoutexplore.plugins.code_digest import digest_of\nprint(digest_of(Agent), digest_of(Agent()))\n"
)


def test_other_processes_find_the_same_until_a_helper_changes(tmp_path: Path) -> None:
    """Sets are in another order there, and everything lies elsewhere in memory."""
    (tmp_path / "beside_package").mkdir()
    for name, text in HELPERS.items():
        write(tmp_path, text, name)
    program = write(tmp_path, PROGRAM, "program.py")

    def found(seed: int) -> str:
        known = os.environ | {"PYTHONHASHSEED": str(seed), "PYTHONDONTWRITEBYTECODE": "1"}
        words = [sys.executable, program]
        return subprocess.run(words, capture_output=True, text=True, check=True, env=known).stdout

    first = found(1)
    assert {found(seed) for seed in (2, 3, 4)} == {first}
    for name, text in HELPERS.items():
        write(tmp_path, text + "\n# another", name)
        assert not set(found(1).split()) & set(first.split()), name
        write(tmp_path, text, name)


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


def test_tensors_and_loggers_count_by_what_they_hold() -> None:
    """As they are pickled, tensors have an address in memory."""
    torch = pytest.importorskip("torch")
    kind = defined(CELL)
    for dtype in (torch.float32, torch.bfloat16, torch.bool):
        one, same, other = (torch.tensor(value, dtype=dtype) for value in ([0, 1], [0, 1], [1, 1]))
        assert digest_of(kind(one)) == digest_of(kind(same)) != digest_of(kind(other))
    nets = [torch.nn.Linear(2, 1) for _ in range(2)]
    assert digest_of(kind(nets[0])) != digest_of(kind(nets[1]))
    nets[1].load_state_dict(nets[0].state_dict())
    assert digest_of(kind(nets[0])) == digest_of(kind(nets[1]))
    assert digest_of(logging.getLogger("a")) != digest_of(logging.getLogger("b"))
