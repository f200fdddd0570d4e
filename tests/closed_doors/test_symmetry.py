"""Mirror images that complete a plan."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.closed_doors.symmetry import best_mirror
from layoutexplore.grids.grid import FREE
from tests.closed_doors.cases import office


@pytest.mark.parametrize("axis", [0, 1])
def test_the_mirror_image_of_a_symmetric_plan_completes_it(axis: int) -> None:
    seen, truth = office((1,)) if axis else (np.ascontiguousarray(cells.T) for cells in office((1,)))
    half = np.concatenate([seen, np.flip(seen, axis)], axis)
    whole = np.concatenate([truth, np.flip(truth, axis)], axis)
    half[tuple(slice(seen.shape[axis], None) if k == axis else slice(None) for k in (0, 1))] = np.flip(
        truth, axis
    )
    mirror = best_mirror(half, 0.05)
    hidden = (whole == FREE) & (half != FREE)
    assert hidden.any() and (mirror.cells[hidden] == FREE).mean() > 0.98
    assert mirror.score > 0.3 and mirror.overlap > 0.9
