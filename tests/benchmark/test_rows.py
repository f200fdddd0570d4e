"""What is said of the columns of results.csv."""

from __future__ import annotations

import inspect

import pytest

from layoutexplore.benchmark.rows import COLUMNS, Row, column_meanings


def test_columns_are_told_however_python_keeps_docstrings(monkeypatch: pytest.MonkeyPatch) -> None:
    told = column_meanings()
    assert tuple(name for name, _ in told) == COLUMNS
    assert all("\n" not in meaning and "  " not in meaning for _, meaning in told)
    monkeypatch.setattr(Row, "__doc__", inspect.cleandoc(Row.__doc__ or ""))  # as Python 3.13 does
    assert column_meanings() == told
