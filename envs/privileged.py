"""What only the floor plan tells, as a vector for the critic of an actor-critic; see `PRIVILEGED_FEATURES`.

A critic that knows how far the rest of the exploration is judges the actor with less noise (asymmetric actor-critic, Pinto et
al., RSS 2018). The policy itself never reads it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from layoutexplore.envs.observation import PRIVILEGED_FEATURES, ObservationConfig, bounds
from layoutexplore.envs.rooms import RoomLedger, room_distances
from layoutexplore.simulation import Simulation
from layoutexplore.tours import improve_tour, open_tour

_LOW, _HIGH = bounds(PRIVILEGED_FEATURES)


class PrivilegedView:
    """Describes one episode to a critic.

    The rest of the exploration is estimated by a tour over the middles of the rooms that have something left to see. It is
    planned once and then kept: rooms that are finished leave it, and local search adapts it to where the robot is.

    Args:
        config: For the scales of lengths and areas.
        simulation: Just after its reset.
        ledger: Of the same episode.
    """

    def __init__(self, config: ObservationConfig, simulation: Simulation, ledger: RoomLedger) -> None:
        self._config, self._simulation, self._ledger = config, simulation, ledger
        self._distances = room_distances(simulation.truth)
        self._order: NDArray[np.int64] | None = None

    def vector(self) -> NDArray[np.float32]:
        """The entries of `PRIVILEGED_FEATURES` now, float32 (features,)."""
        simulation, config, ledger = self._simulation, self._config, self._ledger
        unseen = simulation.target_area * (1.0 - simulation.coverage)
        metres, left = self._tour()
        lengths = np.cumsum(metres)
        # What is left outside of the rooms of the tour, in doors and corners, is taken to be seen evenly on the way.
        seen = np.cumsum(left) / left.sum() * unseen if len(left) else left
        values = (
            simulation.coverage,
            unseen / config.area_scale,
            simulation.target_area / config.area_scale,
            len(metres) / max(1, int(np.count_nonzero(ledger.counted))),
            metres.sum() / config.length_scale,
            _length_until(unseen - 0.05 * simulation.target_area, lengths, seen) / config.length_scale,
            _length_until(unseen - 0.01 * simulation.target_area, lengths, seen) / config.length_scale,
            simulation.distance / simulation.max_distance,
        )
        return np.clip(np.array(values, np.float32), _LOW, _HIGH)

    def _tour(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The legs of the tour in metres and the square metres left in the room at the end of each."""
        open_rooms = self._ledger.open[self._distances.rooms]
        simulation = self._simulation
        order = np.flatnonzero(open_rooms) if self._order is None else self._order[open_rooms[self._order]]
        matrix = np.zeros((len(order) + 1, len(order) + 1))
        cell = simulation.raster.world_to_cell(simulation.pose.x, simulation.pose.y)
        matrix[0, 1:] = matrix[1:, 0] = self._distances.to_rooms(cell)[order]
        matrix[1:, 1:] = self._distances.between[np.ix_(order, order)]
        tour = open_tour(matrix) if self._order is None else improve_tour(matrix, np.arange(1, len(order) + 1))
        self._order = order[tour - 1]
        stops = np.concatenate([[0], tour])
        return matrix[stops[:-1], stops[1:]], self._ledger.left[self._distances.rooms[self._order]]


def _length_until(area: float, lengths: NDArray[np.float64], seen: NDArray[np.float64]) -> float:
    """Metres of the tour after which an area has been seen: 0 when it is nothing, the whole tour when that is not enough."""
    if area <= 0 or len(lengths) == 0:
        return 0.0
    return float(np.interp(area, np.concatenate([[0.0], seen]), np.concatenate([[0.0], lengths])))
