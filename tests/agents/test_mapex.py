"""Expected new area: by hand, against a slow version, and in an exploration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.agents import make_agent
from layoutexplore.agents.mapex import expected_new_area, probability_open
from layoutexplore.benchmark.counterfactual import without_layout
from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.frontiers.visible_area import ray_table, visible_unknown_area
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from tests.plans import TWO_OFFICES


def slow(
    cells: np.ndarray,
    inside: np.ndarray,
    point: tuple[int, int],
    leads_on: float,
    resolution: float,
    reach: float,
    fade: float,
) -> float:
    """The definition, ray by ray, in metres, with plain lists."""
    rows, cols, entered, starts = ray_table(36, reach / resolution)
    total = 0.0
    for ray in range(36):
        steps = range(starts[ray], starts[ray + 1])
        begins = [math.sqrt(entered[n]) * resolution for n in steps] + [reach]
        chances, through = [1.0], 0.0
        for k, n in enumerate(steps):
            r, c = point[0] + rows[n], point[1] + cols[n]
            if not (0 <= r < cells.shape[0] and 0 <= c < cells.shape[1]) or cells[r, c] == 100:
                break
            if cells[r, c] == 0:
                continue
            chances.append(max(float(inside[r, c]), leads_on * math.exp(-through / fade)))
            if min(chances) < 0.01:
                break
            total += min(chances) * (begins[k + 1] ** 2 - begins[k] ** 2) * math.pi / 36
            through += begins[k + 1] - begins[k]
    return total


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    resolution=st.sampled_from([0.05, 0.1, 0.25]),
    reach=st.floats(0.5, 4.0),
    fade=st.floats(0.2, 8.0),
    leads_on=st.floats(0, 1),
)
def test_expected_area_is_that_of_the_definition(
    seed: int, resolution: float, reach: float, fade: float, leads_on: float
) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([-1, 0, 100], np.int8), (23, 31), p=[0.5, 0.45, 0.05])
    inside = rng.random((23, 31)).astype(np.float32) ** 0.2
    point = (int(rng.integers(23)), int(rng.integers(31)))
    found = expected_new_area(
        cells,
        inside,
        np.array([point], np.int32),
        np.array([leads_on]),
        resolution=resolution,
        reach=reach,
        fade=fade,
        rays=36,
    )
    assert found[0] == pytest.approx(
        slow(cells, inside, point, leads_on, resolution, reach, fade), rel=1e-6, abs=1e-9
    )


def test_certainty_is_the_visible_area_and_doubt_is_less() -> None:
    rng = np.random.default_rng(3)
    cells = rng.choice(np.array([-1, 0, 100], np.int8), (60, 60), p=[0.6, 0.36, 0.04])
    points = np.array([[30, 30], [0, 59], [12, 44]], np.int32)

    def area(chance: float, hope: float) -> np.ndarray:
        inside = np.full(cells.shape, chance, np.float32)
        return expected_new_area(cells, inside, points, np.full(3, hope), resolution=0.1, reach=2.5, fade=1.0)

    sure = area(1.0, 0.0)
    assert sure == pytest.approx(visible_unknown_area(cells, points, 0.1, 2.5, 120), rel=1e-9)
    assert area(0.5, 0.0) == pytest.approx(sure / 2, rel=1e-6)
    assert (area(0.5, 0.9) > area(0.5, 0.0)).any() and (area(0.5, 0.9) <= sure + 1e-9).all()
    assert (area(0.0, 0.0) == 0).all()


def test_what_does_not_fit_is_refused() -> None:
    cells, inside, point = (
        np.zeros((4, 4), np.int8),
        np.zeros((4, 4), np.float32),
        np.array([[1, 1]], np.int32),
    )
    good = {"resolution": 0.1, "reach": 1.0, "fade": 1.0}
    with pytest.raises(MapError, match="do not fit"):
        expected_new_area(cells, inside[:3], point, np.zeros(1), **good)
    with pytest.raises(MapError, match="do not fit"):
        expected_new_area(cells, inside, point, np.zeros(2), **good)
    with pytest.raises(ConfigError, match="outside"):
        expected_new_area(cells, inside, point + 9, np.zeros(1), **good)
    with pytest.raises(ConfigError, match="above 0"):
        expected_new_area(cells, inside, point, np.zeros(1), **good | {"fade": 0.0})


def test_it_explores_and_does_without_a_layout() -> None:
    plan = floorplan_from_ascii(TWO_OFFICES, resolution=0.9, name="flat")
    for agent in ("mapex-gain", "mapex-gain-exp", "mapex-gain:reach=3,fade=1"):
        simulation, chosen = prepare(plan, SimulationConfig(sensor="stage"), agent)
        play(simulation, chosen, seed=1)
        assert simulation.stop_reason == "coverage"
    simulation, chosen = prepare(plan, SimulationConfig(sensor="stage"), "mapex-gain")
    decision = simulation.reset(seed=1)
    inside = decision.rooms.inside
    assert inside.shape == decision.grid.shape and inside.min() >= 0 and inside.max() <= 1
    assert (inside[decision.grid.cells >= 0] == 0).all() and inside.max() > 0.3
    assert chosen.act(without_layout(decision)) == make_agent("gain-over-distance").act(decision)
    assert all(0 <= probability_open(f) <= 1 for f in decision.frontiers)
    assert all(probability_open(f) == 0.5 for f in without_layout(decision).frontiers)


def test_numbers_of_numpy_are_counted_with_all_digits() -> None:
    cells, inside = np.full((81, 81), -1, np.int8), np.full((81, 81), 0.7, np.float32)
    given = cells, inside, np.array([[40, 40]], np.int32), np.full(1, 0.9)
    numbers = {"resolution": np.float32(0.1), "reach": np.float32(2.3), "fade": np.float32(1.3)}
    plain = {name: float(number) for name, number in numbers.items()}
    assert expected_new_area(*given, **numbers)[0] == expected_new_area(*given, **plain)[0]
