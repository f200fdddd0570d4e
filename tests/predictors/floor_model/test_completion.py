"""A map completed by the network, of any resolution and orientation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.maps import load_plan
from layoutexplore.models.network_files import load_weights, shapes_of
from layoutexplore.predictors import make_predictor
from layoutexplore.predictors.floor_model.completion import completed_map, known_squares
from layoutexplore.predictors.floor_model.network import LAYERS, WHOLE, FloorNetwork
from layoutexplore.predictors.learned import FLOOR_NETWORK, LearnedPredictor
from layoutexplore.predictors.robot_map import RobotMap
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

SHIPPED = FloorNetwork(load_weights(FLOOR_NETWORK, shapes_of(LAYERS)))


def half_seen(resolution: float = 0.1) -> tuple[Cells, Cells]:
    """Two rooms of 6 x 5 m with a wall between them, but for the corner of the second that nobody has seen.

    The map as it is known, and all of it.
    """
    cell = round(1.0 / resolution)
    whole = np.full((7 * cell, 12 * cell), OCCUPIED, np.int8)
    for first in (cell // 2, 6 * cell):
        whole[cell // 2 : 13 * cell // 2, first : first + 5 * cell] = FREE
    whole[3 * cell : 4 * cell, 5 * cell + cell // 2 : 6 * cell] = FREE
    known = whole.copy()
    known[5 * cell :, 9 * cell :] = UNKNOWN
    return known, whole


def test_the_rest_of_a_room_is_floor() -> None:
    known, whole = half_seen()
    found = completed_map(SHIPPED, known, 0.1, 2.0)
    asked = (known == UNKNOWN) & (whole == FREE)
    assert found.dtype == np.int8 and set(np.unique(found)) <= {FREE, OCCUPIED, UNKNOWN}
    assert (found[asked] == FREE).mean() > 0.9


@pytest.mark.parametrize("resolution", [0.05, 0.025])
def test_finer_cells_are_seen_as_squares(resolution: float) -> None:
    known, _ = half_seen()
    times = round(0.1 / resolution)
    finer = np.kron(known, np.ones((times, times), np.int8))
    assert np.array_equal(known_squares(finer, resolution), known_squares(known, 0.1))
    found = completed_map(SHIPPED, finer, resolution, 2.0)
    assert np.array_equal(found[::times, ::times], completed_map(SHIPPED, known, 0.1, 2.0))


def test_coarser_cells_are_several_squares() -> None:
    known, _ = half_seen(0.2)
    squares = known_squares(known, 0.2)
    assert squares.shape[1] % WHOLE == squares.shape[2] % WHOLE == 0
    rows, cols = known.shape
    for plane, value in zip(squares, (FREE, OCCUPIED), strict=True):
        assert np.array_equal(plane[: 2 * rows : 2, : 2 * cols : 2], known == value)
    assert completed_map(SHIPPED, known, 0.2, 2.0).shape == known.shape


def test_occupied_cells_win_in_a_square() -> None:
    fine = np.array([[-1, 0, -1, -1], [-1, 100, 0, -1]], np.int8)
    free, occupied = known_squares(fine, 0.05)[:, :1, :2]
    assert (free.tolist(), occupied.tolist()) == ([[0, 1]], [[1, 0]])


def test_of_an_empty_map_nothing_is_foreseen() -> None:
    unknown = np.full((30, 40), UNKNOWN, np.int8)
    assert (completed_map(SHIPPED, unknown, 0.1, 2.0) == UNKNOWN).all()


def explored(share: float) -> Decision:
    """A decision of a nearest-frontier exploration of which so much is covered."""
    simulation = Simulation(load_plan("office-04"), SimulationConfig(sensor="indoor"))
    decision = simulation.reset(seed=1)
    while simulation.coverage < share:
        decision = simulation.step(int(decision.table.path_length.argmin()))
    return decision


def judged(name: str, decision: Decision) -> Decision:
    predictor = make_predictor(name)
    assert predictor is not None
    return predictor.predict(decision)


def test_it_is_told_once_no_open_frontier_is_left() -> None:
    early, late = (judged("layout:ahead=2", explored(share)) for share in (0.3, 0.97))
    assert (early.table.closed < 0).any() and early.foresight is None
    assert (late.table.closed > 0).all()
    foresight = late.foresight
    assert foresight is not None and foresight.predictor == "layout:ahead=2"
    hidden = foresight.hidden(late.grid.cells)
    assert (
        hidden.any() and foresight.within(2.0, late.grid.cells).hidden(late.grid.cells).sum() == hidden.sum()
    )
    assert judged("layout", explored(0.97)).foresight is None


def test_a_map_that_lies_askew_is_completed_upright() -> None:
    known, _ = half_seen()
    angle = math.radians(30.0)
    wide = np.pad(known, 60, constant_values=UNKNOWN)
    high, across = wide.shape
    rows, cols = np.mgrid[:high, :across]
    dr, dc = rows - high / 2, cols - across / 2
    at = np.rint([math.cos(angle) * dr - math.sin(angle) * dc + high / 2,
                  math.sin(angle) * dr + math.cos(angle) * dc + across / 2]).astype(int)  # fmt: skip
    inside = (at >= 0).all(axis=0) & (at[0] < high) & (at[1] < across)
    turned = np.where(inside, wide[at[0] % high, at[1] % across], np.int8(UNKNOWN))
    shares = []
    for cells in (wide, turned):
        free = np.argwhere(cells == FREE)
        grid = OccupancyGrid(cells, 0.1, Pose(0.0, 0.0, 0.0))
        middle = grid.cell_to_world(*free[len(free) // 3].tolist())
        robot_map = RobotMap("layout:ahead=3", clean=False)
        decision = robot_map.decide(grid, Pose(*middle, 0.0))
        assert (decision.table.closed > 0).all()
        assert decision.foresight is not None
        shares.append(int(decision.foresight.hidden(decision.grid.cells).sum()))
    assert shares[0] > 300 and abs(shares[1] / shares[0] - 1.0) < 0.35


def test_metres_are_checked() -> None:
    for ahead in (-1.0, 7.0, math.nan):
        with pytest.raises(ConfigError, match="ahead must be"):
            LearnedPredictor(ahead=ahead)
    assert make_predictor("layout:ahead=0").name == "layout"  # type: ignore[union-attr]
