"""What notebooks show of grids, floor plans and layouts."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import cv2
import numpy as np
import pytest

from layoutexplore.drawing.notebook import LONGEST, notebook_png
from layoutexplore.drawing.palette import Image
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps.library import load_plan


def decoded(png: bytes | None) -> Image:
    assert png is not None
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(image, np.uint8)


def test_results_are_shown_as_pictures() -> None:
    plan = load_plan("office-01")
    grid = plan.rasterize(0.1).grid
    shown: list[Any] = [plan, grid, reconstruct(grid)]
    for thing in shown:
        image = decoded(thing._repr_png_())
        assert len(np.unique(image.reshape(-1, 3), axis=0)) >= 2 and thing._repr_png_() == notebook_png(thing)
    assert LONGEST <= max(decoded(notebook_png(plan)).shape) <= 1.1 * LONGEST


@pytest.mark.parametrize("shape", [(1, 1), (30, 20), (3000, 7)])
def test_a_picture_of_a_grid_is_neither_tiny_nor_huge(shape: tuple[int, int]) -> None:
    image = decoded(notebook_png(OccupancyGrid(np.zeros(shape, np.int8), 0.1)))
    assert LONGEST / 2 < max(image.shape) <= LONGEST


def test_a_search_for_a_module_leaves_what_follows_its_import() -> None:
    code = """
import sys, importlib.util, layoutexplore
names = ["gymnasium", "layoutexplore.grids.grid"]
found = [importlib.util.find_spec(name) for name in names]
from layoutexplore.grids.grid import OccupancyGrid
import gymnasium
assert "LayoutExplore/Frontier-v0" in gymnasium.registry and hasattr(OccupancyGrid, "_repr_png_")
assert "layoutexplore.drawing" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
