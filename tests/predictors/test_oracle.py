"""The true plan ahead: doors counted by hand, walls around what is foreseen, kept while nothing changes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, Pose
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import OraclePredictor, make_predictor
from layoutexplore.predictors.room_graph import RoomGraph
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.plans import HOUSE, WIDE_DOORS

PLAN = floorplan_from_ascii(HOUSE, resolution=1.0)


def foreseen_at(
    horizon: float, x: float = 6.5, y: float = 7.5, *, within: float = math.inf, wrong: float = 0.0
) -> tuple[Simulation, Foresight]:
    """A robot in room b of `HOUSE`, beside the door through which little of room a is seen."""
    oracle = OraclePredictor(horizon=horizon, within=within, wrong=wrong)
    simulation = Simulation(PLAN, SimulationConfig(sensor="short"), oracle)
    foresight = simulation.reset(start=Pose(x, y)).foresight
    assert foresight is not None
    return simulation, foresight


def test_doors_are_counted() -> None:
    raster = PLAN.rasterize(0.1)
    names = {room.label: room.id for room in PLAN.rooms}
    graph = RoomGraph(raster)
    known = np.full(raster.shape, UNKNOWN, np.int8)
    known[raster.room_ids == names["b"]] = FREE
    doors = graph.doors_to(known, raster.world_to_cell(6.5, 7.5))
    assert [doors[names[room]] for room in "abcde"] == [1, 0, 3, 2, 3]
    assert np.isinf(doors[0])


def test_a_glimpse_is_no_look_into_a_room() -> None:
    raster = PLAN.rasterize(0.1)
    names = {room.label: room.id for room in PLAN.rooms}
    known = np.full(raster.shape, UNKNOWN, np.int8)
    known[raster.room_ids == names["b"]] = FREE
    inside = np.argwhere(raster.room_ids == names["a"])
    known[tuple(inside[: len(inside) // 11].T)] = FREE
    graph, here = RoomGraph(raster), raster.world_to_cell(6.5, 7.5)
    assert graph.doors_to(known, here)[names["a"]] == 1
    known[tuple(inside[: len(inside) // 9].T)] = FREE
    assert graph.doors_to(known, here)[names["a"]] == 0
    assert graph.doors_to(known, here)[names["d"]] == 1


def test_the_horizon_says_how_far_the_plan_is_foreseen() -> None:
    before = 0
    for horizon, whole in ((0, False), (1, False), (2, True)):
        simulation, foresight = foreseen_at(horizon)
        free = foresight.cells == FREE
        assert (free <= simulation.raster.free).all()
        assert ((foresight.cells == OCCUPIED) <= simulation.raster.occupied).all()
        assert free.sum() > before
        assert np.array_equal(free, simulation.raster.free) == whole
        assert set(np.unique(foresight.room_ids[~free])) == {0}
        before = int(free.sum())


def test_foreseen_space_ends_at_walls_or_at_the_door_of_the_next_room() -> None:
    _, foresight = foreseen_at(1)
    unknown = foresight.cells == UNKNOWN
    free = foresight.cells == FREE
    beside = np.zeros_like(free)
    beside[1:] |= free[1:] & unknown[:-1]
    beside[:-1] |= free[:-1] & unknown[1:]
    beside[:, 1:] |= free[:, 1:] & unknown[:, :-1]
    beside[:, :-1] |= free[:, :-1] & unknown[:, 1:]
    assert beside.any()
    assert set(np.unique(foresight.room_ids[beside])) == {0}


def test_known_and_foreseen_never_contradict_the_truth() -> None:
    simulation = Simulation(floorplan_from_ascii(WIDE_DOORS, resolution=0.5), predictor=OraclePredictor(0, 1))
    decision = simulation.reset()
    while not simulation.done:
        foresight = decision.foresight
        assert foresight is not None
        assert not foresight.contradicted(decision.grid.cells).any()
        assert foresight.confidence == 1.0
        decision = simulation.step(0)


def test_the_same_foresight_until_a_further_room_is_seen() -> None:
    simulation, first = foreseen_at(math.inf)
    assert simulation.step(0).foresight is first


@pytest.mark.parametrize("spec", ["oracle:horizon=-1", "oracle:horizon=1.5", "oracle:horizon=two"])
def test_a_horizon_is_a_number_of_doors(spec: str) -> None:
    with pytest.raises(ConfigError, match=f"horizon is a number of doors.*got '?{spec.partition('=')[2]}"):
        make_predictor(spec)


def test_what_is_foreseen_ends_so_many_metres_beyond_known_floor() -> None:
    simulation, whole = foreseen_at(math.inf)
    known = simulation.decision.grid.cells
    floor = np.argwhere(known == FREE)
    for metres in (0.5, 2.0):
        near = foreseen_at(math.inf, within=metres)[1]
        told = near.cells != UNKNOWN
        assert np.array_equal(near.cells[told], whole.cells[told])
        for row, col in np.argwhere((known == UNKNOWN) & (whole.cells != UNKNOWN))[::20]:
            away = 0.1 * np.hypot(*(floor - (row, col)).T).min()
            # The distance transform is out by some per cent.
            assert told[row, col] if away < 0.95 * metres else away < 1.05 * metres or not told[row, col]


def test_a_share_of_the_squares_is_foreseen_wrongly() -> None:
    _, right = foreseen_at(math.inf)
    _, wrong = foreseen_at(math.inf, wrong=0.2)
    differs, told = wrong.cells != right.cells, right.cells != UNKNOWN
    assert abs(differs[told].mean() - 0.2) < 0.05 and wrong.confidence == 0.8
    squares = [slice(row, row + 4) for row in range(0, 108, 4)]
    whole = [(rows, cols) for rows in squares for cols in squares if told[rows, cols].all()]
    assert {int(differs[square].sum()) for square in whole} == {0, 16}
    assert not wrong.room_ids[wrong.cells != FREE].any()
    assert np.array_equal(foreseen_at(math.inf, wrong=0.2)[1].cells, wrong.cells)


@pytest.mark.parametrize("spec", ["oracle:within=0", "oracle:within=near", "oracle:wrong=1.5"])
def test_distances_and_shares_make_sense(spec: str) -> None:
    with pytest.raises(ConfigError, match=f"{spec[7 : spec.index('=')]}.*{spec.partition('=')[2]}"):
        make_predictor(spec)


def test_names_say_the_horizon() -> None:
    near = "oracle:horizon=inf,within=2,wrong=0.1"
    for spec in ("oracle", "oracle:horizon=2", "oracle:flip=0.1,horizon=inf", near):
        made = make_predictor(spec)
        assert made is not None
        assert made.name == spec


def test_what_lies_in_no_room_is_never_taken_for_a_room() -> None:
    predictor, flipped = OraclePredictor(flip=0.5), []
    for k in range(8):
        plan = floorplan_from_ascii(HOUSE, resolution=1.0 + 0.01 * k)
        Simulation(plan, SimulationConfig(sensor="short"), predictor).reset()
        flipped.append(predictor._flipped)
    flips = np.array(flipped)
    assert flips.any() and not flips[:, 0].any()


def test_infinity_is_not_blamed_for_what_is_no_number() -> None:
    with pytest.raises(ConfigError, match="wrong must be float, got None"):
        OraclePredictor(horizon=math.inf, within=math.inf, wrong=None)  # type: ignore[arg-type]
