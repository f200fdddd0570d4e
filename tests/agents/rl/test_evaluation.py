"""Explorations on fixed cells."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.evaluation import Evaluation, read_evaluations  # noqa: E402
from layoutexplore.errors import ResultsError  # noqa: E402
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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column steps"),
        ("steps,d95\n0,3.0\n", "no column score"),
        ("steps,score,score\n0,1,2\n", "two columns have the same name"),
        ("steps,score\n0\n", "damaged"),
        ("steps,score\n,\n", "'steps' is missing"),
        ("steps,score\n-1,1.0\n", "steps must be a finite number"),
        ("steps,score\n1e30,1.0\n", "steps must be a finite number"),
        ("steps,score\n1,nan\n", "score must be a finite number"),
        ("steps,score,d95\n1,1.0,inf\n", "d95 must be a finite number"),
    ],
)
def test_tables_of_evaluations_that_make_no_sense(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text(text)
    with pytest.raises(ResultsError, match=message):
        read_evaluations(path)


def test_columns_that_came_later_may_be_empty(tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text("steps,score,d95\n0,1.0,\n8,0.5,3.0\n")
    assert read_evaluations(path) == [{"steps": 0, "score": 1.0}, {"steps": 8, "score": 0.5, "d95": 3.0}]
