"""Convolutions against torch-free slow ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from layoutexplore.models import convolution
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


@pytest.mark.parametrize("stride", [1, 2])
def test_no_product_is_so_large_that_threads_would_share_it(
    stride: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    multiplications: list[int] = []
    matmul = np.matmul

    def noted(left: Any, right: Any, **arguments: Any) -> Any:
        multiplications.append(left.shape[-2] * right.size)
        return matmul(left, right, **arguments)

    monkeypatch.setattr(np, "matmul", noted)
    values, weight = np.ones((120, 130, 48), np.float32), np.ones((9 * 48, 64), np.float32)
    convolve(values, weight, 3, stride)
    convolve(values, weight[:48], 1, 1)
    assert 0 < max(multiplications) <= convolution._ONE_THREAD
