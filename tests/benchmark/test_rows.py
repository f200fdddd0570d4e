"""The columns of results.csv."""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any

import pytest

from layoutexplore.benchmark.rows import COLUMNS, Row, column_meanings, format_row, parse_row

NUMBERS = dict.fromkeys((f.name for f in dataclasses.fields(Row) if f.type == "float"), 1.5)
STARTED: dict[str, Any] = NUMBERS | {"start_x": -1.5, "start_y": -2.5, "start_theta": -0.5}
ROW = Row(plan="hall", start=0, sensor="stage", agent="tour", seed=0, **STARTED)


def test_columns_are_told_however_python_keeps_docstrings(monkeypatch: pytest.MonkeyPatch) -> None:
    told = column_meanings()
    assert tuple(name for name, _ in told) == COLUMNS
    assert all("\n" not in meaning and "  " not in meaning for _, meaning in told)
    monkeypatch.setattr(Row, "__doc__", inspect.cleandoc(Row.__doc__ or ""))  # as Python 3.13 does
    assert column_meanings() == told


@pytest.mark.parametrize("name", ["d95", "coverage", "rooms", "wall_seconds"])
def test_a_number_that_no_run_has_is_none_of_its_column(name: str) -> None:
    text = dict(zip(COLUMNS, format_row(ROW).rstrip("\n").split(","), strict=True))
    assert parse_row([*text.values()]) == ROW, "places and headings may be negative"
    for wrong in ("-3", "nan", "1e999"):
        with pytest.raises(ValueError, match=f"{name} cannot be '{wrong}'"):
            parse_row([*(text | {name: wrong}).values()])
