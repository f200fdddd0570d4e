"""A prior plan as fields: how far each point is from walls, and how deep in the floor or in the solid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from layoutexplore.grids.arrays import Floats32, Ints32, Mask
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.priors.evidence import wall_direction
from layoutexplore.priors.plan import PriorPlan

CELL = 0.1
"""Metres a cell of the fields, of the plan at its believed scale; finer drawings are made coarser."""

BORDER = 4.0
"""Metres of outside around a plan."""

FEW_DOORS = 0.05
"""A plan that draws all doors but those of so small a share of its rooms means walls where it draws none."""


@dataclass(frozen=True, eq=False)
class PlanFields:
    """A prior plan, ready to be matched.

    Attributes:
        free: bool (rows, cols), floor.
        room_ids: int32 (rows, cols).
        cell: Metres of the plan a cell.
        low: Coordinate in plan metres of the lower and left edge of the array.
        complete: Whether the plan draws its doors, so that parts without a way between them are apart.
    """

    free: Mask
    room_ids: Ints32
    cell: float
    low: float
    complete: bool

    @cached_property
    def to_walls(self) -> Floats32:
        """float32 (rows, cols): metres to the nearest face of a wall."""
        faces = ~self.free & with_neighbours(self.free)
        distance = cv2.distanceTransform((~faces).astype(np.uint8), cv2.DIST_L2, 5)
        return np.asarray(distance * self.cell, np.float32)

    @cached_property
    def depth(self) -> Floats32:
        """float32 (rows, cols): metres from floor to the nearest solid; negative in the solid."""
        floor = self.free.astype(np.uint8)
        inside = cv2.distanceTransform(floor, cv2.DIST_L2, 5)
        outside = cv2.distanceTransform(1 - floor, cv2.DIST_L2, 5)
        return np.asarray((inside - outside) * self.cell, np.float32)

    @cached_property
    def wings(self) -> Ints32:
        """int32 (rows, cols): the part that one can walk about in without leaving it, from 1; 0 for solid."""
        return np.asarray(cv2.connectedComponents(self.free.astype(np.uint8), connectivity=4)[1], np.int32)

    @cached_property
    def wing_of_room(self) -> Ints32:
        """int32 (highest room id + 1,): the part that each room lies in; 0 for none."""
        found = np.zeros(int(self.room_ids.max(initial=0)) + 1, np.int32)
        found[self.room_ids[self.free]] = self.wings[self.free]
        found[0] = 0
        return found

    @cached_property
    def direction(self) -> float:
        """The direction of most walls, radians 0..pi/2."""
        return wall_direction(self.free)


def make_fields(prior: PriorPlan) -> PlanFields:
    """The fields of a plan."""
    shrink = max(CELL / prior.resolution, 1.0)
    shape = tuple(max(1, round(n / shrink)) for n in prior.free.shape)
    # By the longer side: rounded, it is off by the least share of its length.
    # A plan that is smaller than a cell by its scale, and hence not used, would need any number around it.
    cell = max(prior.resolution * max(prior.free.shape) / max(shape), 0.5 * CELL)
    pad = int(np.ceil(BORDER / cell))
    floor = cv2.resize(prior.free.astype(np.uint8) * 255, shape[::-1], interpolation=cv2.INTER_AREA)
    numbers = prior.room_ids.astype(np.float32)
    ids = cv2.resize(numbers, shape[::-1], interpolation=cv2.INTER_NEAREST).astype(np.int32)
    # A thin wall of a fine drawing stays a wall: floor is what is floor by most of its cell.
    free = floor > 0.6 * 255
    return PlanFields(
        free=np.pad(free, pad),
        room_ids=np.pad(np.where(free, ids, 0), pad).astype(np.int32),
        cell=cell,
        low=-pad * cell,
        complete=prior.doors_missing <= FEW_DOORS,
    )
