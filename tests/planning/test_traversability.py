"""What a robot can plan through and how far it is, on a grid that changes, against everything done anew."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import FREE, OCCUPIED, Cell
from layoutexplore.grids.morphology import inflate
from layoutexplore.planning.shortest_paths import descend, distance_matrix, geodesic_distances
from layoutexplore.planning.traversability import Traversability


def anew(cells: NDArray[np.int8], radius: float, shut: list[Cell]) -> NDArray[np.bool_]:
    """The cells that can be planned through, from the whole grid."""
    traversable = (cells == FREE) & ~inflate(cells == OCCUPIED, radius, 0.1)
    for cell in shut:
        traversable[cell] = False
    return traversable


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_grid_that_changes_in_boxes(data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    rows, cols = data.draw(st.tuples(st.integers(1, 40), st.integers(1, 40)))
    radius = data.draw(st.sampled_from([0.0, 0.1, 0.2, 0.31, 0.9]))
    large = data.draw(st.sampled_from([1, 200, 10_000]))
    cells, traversability, shut = (
        np.full((rows, cols), -1, np.int8),
        Traversability((rows, cols), radius, 0.1, large=large),
        [],
    )
    for _ in range(data.draw(st.integers(1, 20))):
        for _ in range(data.draw(st.integers(0, 2))):
            row, col = int(rng.integers(rows)), int(rng.integers(cols))
            box = (row, int(rng.integers(row, rows)) + 1, col, int(rng.integers(col, cols)) + 1)
            shape = (box[1] - box[0], box[3] - box[2])
            cells[box[0] : box[1], box[2] : box[3]] = rng.choice(
                [-1, 0, 100], p=[0.1, 0.85, 0.05], size=shape
            )
            traversability.note(box)
        if rng.random() < 0.3:
            shut.append(Cell(int(rng.integers(rows)), int(rng.integers(cols))))
            traversability.shut(shut[-1])
        source = Cell(int(rng.integers(rows)), int(rng.integers(cols)))
        stops = np.stack([rng.integers(rows, size=2), rng.integers(cols, size=2)], axis=1).astype(np.int32)
        stop_at = stops if rng.random() < 0.3 else None
        field, traversable = (
            traversability.distances(cells, source, stop_at=stop_at),
            anew(cells, radius, shut),
        )
        expected = geodesic_distances(traversable, source, 0.1, stop_at=stop_at)
        reached = np.argwhere(np.isfinite(expected))
        target = Cell(*reached[rng.integers(len(reached))].tolist())
        np.testing.assert_array_equal(field.to_cells(stops), expected[tuple(stops.T)])
        np.testing.assert_array_equal(field.path_to(target), descend(expected, traversable, target))
        np.testing.assert_array_equal(field.metres(), expected)
        np.testing.assert_array_equal(field.reached, np.isfinite(expected))
        if stop_at is None:
            np.testing.assert_array_equal(np.asarray(field.units)[1:-1, 1:-1] <= field.settled, field.reached)
            some = reached[rng.integers(len(reached), size=6)].astype(np.int32)
            between = distance_matrix(np.isfinite(expected), some, 0.1)
            np.testing.assert_array_equal(field.between(some, 0.1), between)
            np.testing.assert_array_equal(field.lengths_from(Cell(*some[0].tolist()), some, 0.1), between[0])


def test_distances_that_are_gone_are_refused() -> None:
    cells = np.zeros((3, 5), np.int8)
    cells[1, 3] = 100
    cells[:, 4] = -1
    traversability = Traversability(cells.shape, 0.1, 0.1)
    traversability.note((0, 3, 0, 5))
    field = traversability.distances(cells, Cell(0, 0))
    with pytest.raises(ConfigError, match="cannot be reached"):
        field.path_to(Cell(0, 4))
    traversability.distances(cells, Cell(1, 0))
    for ask in (
        field.metres,
        lambda: field.reached,
        lambda: field.path_to(Cell(0, 1)),
        lambda: field.to_cells(np.array([[0, 1]])),
    ):
        with pytest.raises(ConfigError, match="a decision that is over"):
            ask()
    with pytest.raises(ConfigError, match="outside"):
        traversability.distances(cells, Cell(0, 5))
