"""Between the frame of the grid and that of the world."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.grids.grid import Pose
from layoutexplore.layout.frame import angles_to_local, angles_to_world


def test_angles_to_local_undoes_angles_to_world() -> None:
    origin, angles = Pose(1.0, 2.0, 2.5), np.array([0.0, 1.0, 3.0])
    assert angles_to_local(angles_to_world(angles, origin), origin) == pytest.approx(angles)
