"""Performance profiles: shares of cells within a factor of the best agent."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.benchmark.rows import Row
from layoutexplore.report.plots import agent_looks
from layoutexplore.report.profiles import factors_of_best, profile_plot, share_within


def row(plan: str, agent: str, d95: float, *, reached: bool = True, error: str = "") -> Row:
    return Row(
        plan=plan, start=0, sensor="stage", agent=agent, seed=0, d95=d95, reached95=reached, error=error
    )


ROWS = [
    row("a", "nearest", 10.0),
    row("a", "tour", 20.0),
    row("b", "nearest", 30.0),
    row("b", "tour", 15.0, reached=False),
    row("c", "tour", 5.0),  # nearest did not run there
    row("d", "nearest", 8.0, reached=False),
    row("d", "tour", 9.0, reached=False),  # nobody saw 95 %
    row("e", "nearest", 12.0),
    row("e", "tour", 9.0),
    row("e", "random", math.nan, error="Boom"),
]


def test_factors_are_to_the_best_in_cells_that_all_ran() -> None:
    factors = factors_of_best(ROWS, ["nearest", "tour"])
    assert factors.tolist() == [[1.0, 1.0, 12 / 9], [2.0, math.inf, 1.0]]


def test_the_plot_shows_wins_and_failures() -> None:
    rows = [*ROWS, *(row(plan, "clairvoyant", 1.0) for plan in "abe")]
    looks = agent_looks(["tour", "nearest", "clairvoyant"], "nearest")
    plot = profile_plot(rows, looks, {"clairvoyant"})
    assert plot is not None and plot.cells == 3
    assert [line.name for line in plot.lines] == [
        "nearest",
        "tour",
    ]  # the one that knows the plan is no rival
    nearest, tour = plot.lines
    assert nearest.path.startswith(f"M0.00,{100 / 3:.2f} H") and nearest.path.endswith("V0.00 H100.00")
    assert tour.path.startswith(f"M0.00,{200 / 3:.2f} H") and tour.end == round(100 / 3, 2)
    assert nearest.colour == looks["nearest"][0] and nearest.label_at < tour.label_at
    assert profile_plot([r for r in ROWS if r.agent == "tour"], looks, ()) is None


@given(st.lists(st.floats(1, 10) | st.just(math.inf), min_size=1, max_size=30), st.floats(1, 12))
def test_shares_count_the_factors(factors: list[float], at: float) -> None:
    values, shares = share_within(np.array(factors))
    expected = sum(f <= at for f in factors) / len(factors)
    assert shares[np.searchsorted(values, at, side="right") - 1] == expected
