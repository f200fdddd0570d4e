"""Shapes that rooms are completed to without learning."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.predictors.shape_baselines import main_angle


def test_main_angle() -> None:
    rows, cols = np.mgrid[:120, :120]
    along, across = cols * np.cos(0.3) + rows * np.sin(0.3), rows * np.cos(0.3) - cols * np.sin(0.3)
    walls = ((along % 40) < 2) | ((across % 40) < 2)
    assert main_angle(np.where(walls, 100, 0).astype(np.int8), 0.05) == pytest.approx(0.3, abs=0.03)
