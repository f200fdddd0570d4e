"""Explorations on fixed cells."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.evaluation import Evaluation  # noqa: E402
from tests.agents.rl.cases import small_config  # noqa: E402


def test_references_are_explored_once(tmp_path: Path) -> None:
    evaluation = Evaluation(small_config(tmp_path))
    first = evaluation.compare(make_agent("nearest"))
    assert first["d95_ratio.nearest"] == first["d99_ratio.nearest"] == 1.0
    assert evaluation.compare(make_agent("tour"), lambda: True) == {}


def test_it_is_given_up_within_an_exploration(tmp_path: Path) -> None:
    asked = []

    def stop() -> bool:
        asked.append(True)
        return len(asked) > 5

    assert Evaluation(small_config(tmp_path)).compare(make_agent("nearest"), stop) == {}
    assert len(asked) < 12
