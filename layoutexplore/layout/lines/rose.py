"""ROSE alone: directions, structure score and the decluttered map (ICRA 2021), without rooms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid
from layoutexplore.layout.frame import angles_to_world
from layoutexplore.layout.lines.assemble import clean_grid
from layoutexplore.layout.lines.declutter import DeclutterConfig, find_structure, mixture_threshold
from layoutexplore.layout.pipeline import register_method
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout, ScoreDetails


@dataclass(frozen=True, kw_only=True)
class RoseConfig(DeclutterConfig):
    """Every option of the rose method; see also `DeclutterConfig`.

    The floor is higher than in the other methods: with it the structure score follows the precision
    (correlation below -0.7).

    Attributes:
        threshold: Least score of structure; None for the crossing of the two Gaussians fitted to the scores.
    """

    prominence: float = 0.5
    floor: float = 0.04
    threshold: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.threshold is not None and not 0 <= self.threshold <= 1:
            raise ConfigError(f"threshold must lie between 0 and 1, got {self.threshold}")


def rose(grid: OccupancyGrid, config: RoseConfig) -> Layout:
    """Declutter a grid; the layout has directions, scores and a clean grid but no rooms."""
    timer = StageTimer()
    occupied = grid.cells == OCCUPIED
    with timer("structure"):
        structure = find_structure(occupied, grid.resolution, config)
    with timer("threshold"):
        threshold = (
            mixture_threshold(structure.cell_scores[occupied])
            if config.threshold is None
            else config.threshold
        )
        kept = occupied & (structure.cell_scores >= threshold)
    warnings = []
    if not len(structure.directions):
        warnings.append("no dominant direction: the map has no structure that ROSE could keep")
        kept = occupied
    elif structure.score > 0.4:
        warnings.append(f"structure score {structure.score:.2f} is above 0.4: the decluttering has failed")
    return Layout(
        method="rose",
        clean_grid=clean_grid(grid, kept),
        labels=np.zeros(grid.shape, np.int32),
        directions=np.sort(angles_to_world(structure.directions, grid.origin)),
        structure_score=structure.score,
        timings=timer.seconds,
        warnings=tuple(warnings),
        details=ScoreDetails(structure.cell_scores),
    )


register_method("rose", "ROSE: directions and scores of the walls, no rooms", rose, RoseConfig)
