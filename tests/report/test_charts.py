"""The axes of small charts."""

from __future__ import annotations

import itertools

import pytest

from layoutexplore.metrics.statistics import NO_INTERVAL, Interval
from layoutexplore.report.charts import line_chart


@pytest.mark.parametrize(
    ("values", "least", "greatest"),
    [
        ((0.8, 1.4), "0.75", "1.5"),
        ((0.3, 1.4), "0.25", "1.5"),
        ((1.0, 2.2), "0.75", "2.25"),
        ((), "0.75", "1.5"),
    ],
)
def test_an_axis_reaches_as_far_as_the_values(values: tuple[float, ...], least: str, greatest: str) -> None:
    intervals = [Interval(value, value, value) for value in values] or [NO_INTERVAL]
    chart = line_chart({"nearest": intervals}, [str(k) for k in range(len(intervals))], low=0.75, high=1.5)
    assert (chart.ticks.y[0], chart.ticks.y[-1]) == ((100.0, least), (0.0, greatest))
    assert all(0 < point.y < 100 for point in chart.series[0].points), "none is drawn at an edge"


def test_an_axis_reaches_as_far_as_the_whiskers_unless_they_are_long() -> None:
    whiskers = [Interval(0.84, 0.71, 0.95), Interval(1.1, 0.9, 1.9)]
    chart = line_chart({"nearest": whiskers}, ["low", "high"], low=0.75, high=1.5)
    assert (chart.ticks.y[0][1], chart.ticks.y[-1][1]) == ("0.5", "2")
    assert all(0 < point.high < point.low < 100 for point in chart.series[0].points)
    chart = line_chart({"nearest": [Interval(1.1, 0.9, 60.0)]}, ["high"], low=0.75, high=1.5)
    assert chart.ticks.y[-1][1] == "2.25" and chart.series[0].points[0].high == 0


def test_labels_of_a_long_axis_have_room() -> None:
    chart = line_chart({"lost": [Interval(9.0, 8.0, 12.0)]}, ["high"], low=0.75, high=1.5)
    places = [at for at, _ in chart.ticks.y]
    assert min(below - above for below, above in itertools.pairwise(places)) > 8
