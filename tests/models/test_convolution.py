"""Convolutions against torch-free slow ones."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.models.convolution import convolve, neighbourhoods


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("shape", [(1, 1), (4, 6), (7, 5), (61, 300)])  # the last in several strips
def test_convolution_against_a_slow_one(shape: tuple[int, int], stride: int) -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(*shape, 3)).astype(np.float32)
    weight = rng.normal(size=(27, 4)).astype(np.float32)
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    slow = np.array(
        [
            [padded[r : r + 3, c : c + 3].ravel() for c in range(0, shape[1], stride)]
            for r in range(0, shape[0], stride)
        ]
    )
    np.testing.assert_array_equal(neighbourhoods(values[None], stride)[0], slow)
    np.testing.assert_allclose(convolve(values, weight, 3, stride), slow @ weight, rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(convolve(values, weight[:3], 1, 1), values @ weight[:3])
