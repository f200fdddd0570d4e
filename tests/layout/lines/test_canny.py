import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.lines.canny import canny_edges
from layoutexplore.layout.pipeline import reconstruct


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.integers(1, 24), st.integers(1, 24))
def test_edges_are_those_of_opencv(seed, share, rows, cols):
    rng = np.random.default_rng(seed)
    mask = np.kron(rng.random((rows, cols)) < share, np.ones((2, 3), bool))
    # within a frame without edges, where OpenCV's detector stays inside its buffers
    mask = np.pad(mask, 20)
    for low, high in ((90, 100), (2000, 9000), (500, 50)):
        expected = cv2.Canny(mask.astype(np.uint8) * 255, low, high, apertureSize=5) > 0
        np.testing.assert_array_equal(canny_edges(mask, low, high), expected)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (2, 2)])
def test_small_masks_have_edges_of_their_size(shape):
    assert canny_edges(np.ones(shape, bool), 90, 100).shape == shape
    assert not canny_edges(np.ones(shape, bool), 90, 100).any()


def test_a_mesh_of_thin_walls_does_not_end_the_process():
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        for step in (2, 4, 8):
            cells = np.zeros((200, 200), np.int8)
            cells[::step] = cells[:, ::step] = 100
            layout = reconstruct(OccupancyGrid(cells, 0.05), "ias15")
            assert layout.labels.shape == cells.shape
    finally:
        cv2.setNumThreads(threads)
