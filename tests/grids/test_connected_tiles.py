"""Cells that are connected with a source, followed through changes, against labelling everything anew."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from layoutexplore.grids.connected_tiles import TILE, ConnectedTiles


@given(seed=st.integers(0, 2**32), density=st.sampled_from([0.02, 0.3, 0.45, 0.6]))
@settings(max_examples=80, deadline=None)
def test_connected_cells_are_those_of_the_label(seed: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 3 * TILE + 5, 2).tolist())
    world, tiles = np.zeros(shape, np.uint8), ConnectedTiles(shape)
    for _ in range(6):
        row, col = (int(rng.integers(n)) for n in shape)
        part = world[row : row + int(rng.integers(1, 2 * TILE)), col : col + int(rng.integers(1, 2 * TILE))]
        part[:] = rng.random(part.shape) > density
        tiles.note((np.argwhere(np.ones_like(part)) + np.array([row, col])).astype(np.int32))
        open_cells = np.argwhere(world)
        if len(open_cells) == 0:
            continue
        row, col = open_cells[rng.integers(len(open_cells))].tolist()
        tiles.update(world, row, col)
        labels = ndimage.label(world)[0]
        np.testing.assert_array_equal(tiles.barred == 0, labels == labels[row, col])


def test_many_parts_in_one_tile() -> None:
    """More parts than have a bit of their own: which of them the source moves to is still told apart."""
    world = np.zeros((TILE, TILE), np.uint8)
    world[::2, ::2] = 1
    tiles = ConnectedTiles(world.shape)
    tiles.note(np.argwhere(world).astype(np.int32))
    for row, col in ((30, 30), (28, 30), (0, 0), (30, 28)):
        tiles.update(world, row, col)
        assert np.argwhere(tiles.barred == 0).tolist() == [[row, col]]


def test_more_parts_in_one_tile_than_a_byte_numbers() -> None:
    world = np.zeros((2 * TILE, 2 * TILE), np.uint8)
    world[::2, ::2] = world[1::2, 1::2] = 1
    tiles = ConnectedTiles(world.shape)
    tiles.note(np.argwhere(world == 1)[:, :2].astype(np.int32))
    for row, col in ((31, 31), (0, 0), (63, 1)):
        tiles.update(world, row, col)
        assert np.argwhere(tiles.barred == 0).tolist() == [[row, col]]
    world[0, :] = 1
    tiles.note(np.argwhere(np.ones((1, 2 * TILE))).astype(np.int32))
    tiles.update(world, 0, 0)
    labels = ndimage.label(world)[0]
    np.testing.assert_array_equal(tiles.barred == 0, labels == labels[0, 0])
