"""Code of a user's own, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from layoutexplore.agents import AGENTS
from layoutexplore.predictors import PREDICTORS

AGENT = '''
"""An agent of my own."""
STEP = 0

class Mine:
    """Goes to the STEPth frontier. And more."""

    def __init__(self, skip: int = 0, gain: float = 1.0) -> None:
        self.skip = skip

    def reset(self, seed: int) -> None:
        pass

    def act(self, decision):
        return min(self.skip, len(decision.frontiers) - 1)
'''


def write(folder: Path, text: str = AGENT, name: str = "mine.py") -> str:
    """A file with code, by its path."""
    (folder / name).write_text(text)
    return str(folder / name)


@pytest.fixture(autouse=True)
def nothing_stays_registered() -> Iterator[None]:
    """Own agents and predictors of a test are gone after it."""
    yield
    for registry in (AGENTS, PREDICTORS):
        for entry in registry.own():
            registry.remove(entry.name)
