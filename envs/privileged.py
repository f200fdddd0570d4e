"""What only the floor plan tells, as a vector for the critic of an actor-critic; see `PRIVILEGED_FEATURES`.

A critic that knows how far the rest of the exploration is judges the actor with less noise (asymmetric
actor-critic, Pinto et al., RSS 2018). The policy itself never reads it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.envs.observation import PRIVILEGED_FEATURES, ObservationConfig, bounds
from layoutexplore.envs.room_progress import RoomLedger, room_distances
from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Floats, Floats32, Ints, Mask
from layoutexplore.metrics.exploration import FULLY_SEEN, NEARLY_SEEN
from layoutexplore.planning.tours import construct, improve
from layoutexplore.simulation.simulation import Simulation

_LOW, _HIGH = bounds(PRIVILEGED_FEATURES)

_UNSEEN_SHARES = np.round(1.0 - np.array([NEARLY_SEEN, FULLY_SEEN]), 6)
"""What is still unseen at the two coverage thresholds, 0..1."""


@checks_making
class PrivilegedView:
    """Describes one episode to a critic.

    The rest of the exploration is estimated by a tour over the middles of the rooms that have something left
    to see. It is planned once and then kept: rooms that are finished leave it, and local search adapts it to
    where the robot is.

    Args:
        config: For the scales of lengths and areas.
        simulation: Just after its reset.
        ledger: Of the same episode.
    """

    def __init__(self, config: ObservationConfig, simulation: Simulation, ledger: RoomLedger) -> None:
        self._config, self._simulation, self._ledger = config, simulation, ledger
        self._distances = room_distances(simulation.truth)
        self._order = np.empty(0, np.int64)

    def vector(self) -> Floats32:
        """The entries of `PRIVILEGED_FEATURES` now, float32 (features,)."""
        simulation, config, ledger = self._simulation, self._config, self._ledger
        unseen, rooms = simulation.target_area * (1.0 - simulation.coverage), self._distances.rooms
        is_open, left = ledger.open[rooms], ledger.left[rooms]
        cell = simulation.raster.world_to_cell(simulation.pose.x, simulation.pose.y)
        areas = _UNSEEN_SHARES * simulation.target_area
        between, to_rooms = self._distances.between, self._distances.to_rooms(cell)
        self._order, *lengths = _plan(between, to_rooms, self._order, is_open, left, unseen, areas)
        values = (
            simulation.coverage,
            unseen / config.area_scale,
            simulation.target_area / config.area_scale,
            len(self._order) / max(1, int(np.count_nonzero(ledger.counted))),
            *(length / config.length_scale for length in lengths),
            simulation.distance / simulation.max_distance,
        )
        return np.array(values, np.float32).clip(_LOW, _HIGH)


@njit(cache=True, nogil=True)
def _plan(
    between: Floats, to_rooms: Floats, order: Ints, is_open: Mask, left: Floats, unseen: float, areas: Floats
) -> tuple[Ints, float, float, float]:
    """The order over open rooms, its length, and the lengths after which only two areas are unseen.

    Lengths are in metres, areas in square metres. An empty order is a tour that has not been planned; one
    that has is kept, as far as its rooms are open, and improved. What is left outside of the rooms of the
    tour, in doors and corners, is taken to be seen evenly along it.
    """
    rooms = (order[is_open[order]] if len(order) else np.flatnonzero(is_open)).astype(np.int64)
    count = len(rooms)
    # Index 0 is the robot, k + 1 the k-th open room.
    matrix = np.zeros((count + 1, count + 1))
    for k in range(count):
        matrix[0, k + 1] = matrix[k + 1, 0] = to_rooms[rooms[k]]
        for j in range(count):
            matrix[k + 1, j + 1] = between[rooms[k], rooms[j]]
    tour = np.arange(count + 1) if len(order) else construct(matrix)
    improve(matrix, tour)
    rooms = rooms[tour[1:] - 1]
    total = left[rooms].sum()
    until = np.zeros(2)
    length, seen = 0.0, 0.0
    for k in range(count):
        leg, found = matrix[tour[k], tour[k + 1]], left[rooms[k]] / total * unseen
        for m in range(2):
            # The share of the leg until that area is left; floor comes into view evenly along a leg.
            until[m] += leg * min(max((unseen - areas[m] - seen) / found, 0.0), 1.0)
        length, seen = length + leg, seen + found
    return rooms, length, until[0], until[1]
