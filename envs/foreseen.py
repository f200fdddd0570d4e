"""What a predictor foresees of space that nobody has seen, for networks: two channels, a vector, a reward.

Everything is zero without a predictor that foresees, and while it is not sure (see
`layoutexplore.frontiers.foresight`).
"""

from __future__ import annotations

import numpy as np

from layoutexplore.envs.egocentric_maps import FIRST_MARK
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Bytes, Floats32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

FORESIGHT_CHANNELS = ("foreseen_floor", "foreseen_wall")
"""255 where a pixel holds unknown cells that are foreseen free, or foreseen solid."""

FORESIGHT_FEATURES: dict[str, tuple[float, float]] = {
    "confidence": (0.0, 1.0),
    "floor": (0.0, 1000.0),
    "rooms": (0.0, 1000.0),
}
"""The entries of the vector `foresight` and their bounds: how sure it is, the floor that is foreseen and not
seen yet (units of `area_scale`), and the number of foreseen rooms with a square metre of it."""

LEFT_IN_ROOM = 1.0
"""Square metres that are left to see in a room that counts."""


def mark_foreseen(decision: Decision, marks: Bytes, channel: int) -> None:
    """Mark the cells that are not known and foreseen.

    Args:
        decision: What the robot knows and foresees.
        marks: uint8 (rows, cols), bits as of `layoutexplore.envs.egocentric_maps`, written to.
        channel: Of foreseen floor in the maps; that of foreseen walls is the next one.
    """
    foresight = decision.foresight
    if foresight is not None:
        unknown, floor = decision.grid.cells == UNKNOWN, 1 << (channel - FIRST_MARK)
        marks[unknown & (foresight.cells == FREE)] |= floor
        marks[unknown & (foresight.cells == OCCUPIED)] |= 2 * floor


def encode_foresight(decision: Decision, area_scale: float) -> Floats32:
    """float32 (features,): the entries of `FORESIGHT_FEATURES`; zeros where nothing is foreseen."""
    foresight = decision.foresight
    if foresight is None:
        return np.zeros(len(FORESIGHT_FEATURES), np.float32)
    rooms = foresight.room_ids[foresight.hidden(decision.grid.cells)]
    left = np.bincount(rooms) * foresight.resolution**2
    values = (
        foresight.confidence,
        len(rooms) * foresight.resolution**2 / area_scale,
        np.count_nonzero(left[1:] >= LEFT_IN_ROOM),
    )
    low, high = np.array(list(FORESIGHT_FEATURES.values()), np.float32).T
    return np.clip(np.array(values, np.float32), low, high)


def hidden_floor(decision: Decision) -> Mask | None:
    """Bool (rows, cols): what is foreseen free and not known yet; None where nothing is foreseen."""
    foresight = decision.foresight
    return None if foresight is None else foresight.hidden(decision.grid.cells)


def came_true(hidden: Mask | None, grid: OccupancyGrid) -> float:
    """Square metres of floor that were foreseen and are known to be free now."""
    if hidden is None or hidden.shape != grid.shape:
        return 0.0
    return float(np.count_nonzero(hidden & (grid.cells == FREE))) * grid.resolution**2
