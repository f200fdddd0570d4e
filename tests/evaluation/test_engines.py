"""Empty cells are rows, each once; the seconds of a run are those between the ends of runs."""

from __future__ import annotations

import pytest

from layoutexplore.evaluation import engines


def test_every_cell_becomes_a_row() -> None:
    rate, seconds, megabytes = engines.empty_cells("", 3000)
    assert rate > 0.0 and seconds > 0.0 and 10.0 < megabytes < 1e5


def test_rows_of_engines_and_efficiency(monkeypatch: pytest.MonkeyPatch) -> None:
    """One row an engine, in the order of the page, and the share of two processes that is worth something."""
    monkeypatch.setattr(engines, "empty_cells", lambda cluster, count: (2500.0, 9.0, 99.0))
    monkeypatch.setattr(engines, "run_seconds", lambda jobs, starts: {1: 0.9, 2: 0.5}[jobs])
    monkeypatch.setattr(engines, "usable_cores", lambda: 2)
    monkeypatch.setattr(engines, "find_spec", lambda module: module != "ray")
    *rows, efficiency = engines.engines()
    assert [row.name for row in rows] == ["400000 empty cells, local processes", "400000 empty cells, Dask"]
    assert all(row.missed and row.reached == 0.5 for row in rows)
    assert efficiency.ours == pytest.approx(0.9) and efficiency.reached and not efficiency.missed
    monkeypatch.setattr(engines, "usable_cores", lambda: 1)
    assert [*engines.engines()][-1].reached is None  # two processes on one core gain nothing


def test_a_run_takes_time() -> None:
    assert 0.0 < engines.run_seconds(1, 4) < 60.0
