"""What own code takes, by its signature."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.plugins.own_code import reference_in
from layoutexplore.plugins.signatures import buildable, check_takes

MINE = """
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from layoutexplore import Decision

class Mine:
    def __init__(self, size: float = 1.5, before: Decision = ""): ...
    def choose(self, decision: Decision) -> Decision: ...
    def rank(self, decision: Decision, last: Decision) -> Decision: ...
"""


def test_names_in_annotations_may_be_imported_for_type_checkers_alone(tmp_path: Path) -> None:
    """From Python 3.14 on also where they are no texts."""
    text = MINE if sys.version_info >= (3, 14) else MINE.replace(": Decision", ": 'Decision'")
    path = tmp_path / "mine.py"
    path.write_text(text.replace("-> Decision", "-> 'Decision'"), encoding="utf-8")
    found = reference_in(f"{path}:Mine")
    assert found is not None
    build, options = buildable(found.load(), "agent mine")
    assert (options.size, options.before) == (1.5, "")
    mine = build("mine", options)
    check_takes(mine.choose, "decision", "agent mine: its choose")
    with pytest.raises(ConfigError, match=r"its rank takes \(decision: 'Decision', last: 'Decision'\)"):
        check_takes(mine.rank, "decision", "agent mine: its rank")
