"""What one can expect to see from a frontier, by a predicted layout's probabilities, per metre of path.

After MapEx (Ho et al., "MapEx: Indoor Structure Exploration with Probabilistic Information Gain from Global
Map Predictions", 2024): there an ensemble of image completions says how likely every unseen cell is free, a
virtual sensor at the frontier looks through what is probably free, and the gain is divided by the distance.
Here the probabilities are those of the predictor's trees, and the gain is the unknown area that one can
expect to see.

On a ray the cell at distance r is seen when nothing before it blocks the view. Predicted free cells along a
ray stand or fall together (they are free because the wall is further away), so the probability is the
smallest one on the way, not their product. Beyond what the trees judge, a frontier that leads on may show
another room: its probability of being open, fading with the distance seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.agents.base import register, settle_predictor
from layoutexplore.agents.greedy import Candidates, Greedy, GreedyOptions, Scores, faded
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.frontiers.table import Frontier
from layoutexplore.frontiers.visible_area import RayTable, ray_table
from layoutexplore.grids.arrays import Cells, Floats, Floats32, Ints, Ints32
from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.options import option

RAYS = 120


@dataclass(frozen=True, kw_only=True)
class ProbabilisticOptions(GreedyOptions):
    """Parameters of `ProbabilisticGain`."""

    reach: float = option(
        8.0, "metres that are looked into the unknown, the sensor's range at most", low=0.1, high=100.0
    )
    fade: float = option(4.0, "metres in which the hope to see into another room falls to a third", low=0.01)
    rate: float = option(
        0.0, "1/m: gain x exp(-rate x path length); 0: gain / path length, as in MapEx", low=0.0
    )
    predictor: str = option("layout", "where probabilities come from")

    def __post_init__(self) -> None:
        """What means the same predictor has one name."""
        super().__post_init__()
        settle_predictor(self)


class ProbabilisticGain(Greedy[ProbabilisticOptions]):
    """Expected new area in sight over path length; without a layout, the unknown area in sight instead."""

    @property
    def predictor(self) -> str:
        """The predictor that the simulation has to run for this agent."""
        return self.options.predictor

    def scores(self, among: Candidates) -> Scores:
        """In square metres per metre, or, with a rate, in square metres up to a factor that all share."""
        gains, lengths = self.gains(among), among.table.path_length
        if self.options.rate > 0:
            return faded(gains, lengths, self.options.rate)
        return gains / np.maximum(lengths, among.decision.grid.resolution)

    def gains(self, among: Candidates) -> Floats:
        """Expected new areas float64 (k,), in square metres."""
        decision, numbers, table = among
        if decision.rooms is None:
            return table.visible_area
        return expected_new_area(
            decision.grid.cells,
            decision.rooms.inside,
            decision.viewpoints[numbers],
            np.array([probability_open(decision.frontiers[i]) for i in numbers]),
            resolution=decision.grid.resolution,
            reach=min(self.options.reach, decision.sensor.range_max),
            fade=self.options.fade,
        )


def probability_open(frontier: Frontier) -> float:
    """The predictor's probability that a frontier leads on; a half where there is no prediction."""
    if frontier.confidence is None:
        return 0.5
    return 1.0 - frontier.confidence if frontier.is_closed else frontier.confidence


def expected_new_area(
    cells: Cells,
    inside: Floats32,
    viewpoints: Ints32,
    leads_on: Floats,
    *,
    resolution: float,
    reach: float,
    fade: float,
    rays: int = RAYS,
) -> Floats:
    """Unknown area that one can expect to see from viewpoints.

    A piece of ring between the distances a and b of a ray through an unknown cell counts (b^2 - a^2) pi /
    rays square metres, times the probability that it is seen: the least of p = max(inside, leads_on exp(-s /
    fade)) on the way, with s the metres walked by the ray through the unknown.

    Args:
        cells: int8 (rows, cols).
        inside: float32 (rows, cols), probability that an unknown cell is free, 0..1.
        viewpoints: int32 (n, 2) as (row, col), inside the grid.
        leads_on: float64 (n,), probability that what is not judged inside is open.
        resolution: Metres per cell.
        reach: How far to look, in metres.
        fade: Metres in which the probability to see on falls to 1/e.
        rays: Number of rays.

    Returns:
        float64 (n,) in square metres.

    Raises:
        MapError: Arrays whose shapes do not fit each other.
        ConfigError: A viewpoint lies outside of the grid, or a number is not above 0.

    Example:
        >>> cells = np.full((101, 101), -1, np.int8)
        >>> sure = np.ones((101, 101), np.float32)
        >>> here = np.array([[50, 50]], np.int32)
        >>> area = expected_new_area(cells, sure, here, np.zeros(1), resolution=0.1, reach=3.0, fade=1.0)
        >>> area.round(1).tolist()  # pi * 3.0 ** 2
        [28.3]
    """
    points = np.asarray(viewpoints, np.int64).reshape(-1, 2)
    if cells.ndim != 2 or inside.shape != cells.shape or np.shape(leads_on) != (len(points),):
        raise MapError(
            f"cells {cells.shape}, inside {inside.shape} and leads_on {np.shape(leads_on)} do not fit"
        )
    if not (all(math.isfinite(v) and v > 0 for v in (resolution, reach, fade)) and rays >= 1):
        raise ConfigError(
            f"resolution, reach, fade and rays must be above 0, got {resolution}, {reach}, {fade}, {rays}"
        )
    if points.size and ((points < 0).any() or (points >= cells.shape).any()):
        raise ConfigError(f"a viewpoint lies outside of the grid of shape {cells.shape}")
    view = _View(
        np.ascontiguousarray(cells),
        np.ascontiguousarray(inside, dtype=np.float32),
        points,
        np.asarray(leads_on, np.float64),
    )
    area = np.zeros(len(points), np.float64)
    # Of numbers of NumPy's, the kernel would be compiled once more, and count with the digits that they have.
    resolution, reach, fade = float(resolution), float(reach), float(fade)
    _expect(view, ray_table(int(rays), reach / resolution), reach / resolution, fade / resolution, area)
    return area * (math.pi / rays * resolution**2)


class _View(NamedTuple):
    """The grid, the probabilities inside, the viewpoints, and how likely what lies behind each is open."""

    cells: Cells
    inside: Floats32
    points: Ints
    leads_on: Floats


@njit(cache=True, nogil=True)
def _expect(view: _View, rays: RayTable, reach: float, fade: float, area: Floats) -> None:
    """Sum over the rays of p (b^2 - a^2) over the unknown cells from a to b, all in cells."""
    height, width = view.cells.shape
    for k in range(len(view.points)):
        row, col = view.points[k]
        for ray in range(len(rays.starts) - 1):
            # `chance` is the least probability so far on the ray; `through` counts unknown cells alone.
            chance, through = 1.0, 0.0
            for n in range(rays.starts[ray], rays.starts[ray + 1]):
                r, c = row + rays.rows[n], col + rays.cols[n]
                if not (0 <= r < height and 0 <= c < width) or view.cells[r, c] == OCCUPIED:
                    break
                if view.cells[r, c] == FREE:
                    continue
                # A cell ends where the next one of its ray begins, the last at the reach; squared distances.
                end = rays.entered[n + 1] if n + 1 < rays.starts[ray + 1] else reach * reach
                hope = view.leads_on[k] * math.exp(-through / fade)
                chance = min(chance, max(view.inside[r, c], hope))
                # What is left of the ray adds next to nothing.
                if chance < 0.01:
                    break
                area[k] += chance * (end - rays.entered[n])
                through += math.sqrt(end) - math.sqrt(rays.entered[n])


register(
    "mapex-gain",
    "area one can expect to see, by the layout's probabilities / path length",
    ProbabilisticGain,
    ProbabilisticOptions(),
)
register(
    "mapex-gain-exp",
    "the same area x exp(-0.2 x path length)",
    ProbabilisticGain,
    ProbabilisticOptions(rate=0.2),
)
