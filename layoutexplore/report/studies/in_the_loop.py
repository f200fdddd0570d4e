"""The page of an evaluation of layout methods in the loop: one table, and the rooms each believed in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from layoutexplore.benchmark.analysis import FailedRuns
from layoutexplore.drawing import palette
from layoutexplore.drawing.room_fills import fills_of_rooms
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.in_the_loop import BASELINE, DRIVER, LoopScore
from layoutexplore.files import safe_name, write_atomically, write_csv
from layoutexplore.grids.arrays import Bytes
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.metrics.overlaps import shared_cells
from layoutexplore.metrics.statistics import NO_INTERVAL, Interval
from layoutexplore.predictors.protocol import RoomLabels
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.report.templates import png_uri, render

WIDTH = 420
"""Pixels: pictures are about so wide."""

HIDDEN = 0.45
"""Share of a room's colour where the room has not been seen."""

FAINT = 0.25
"""Share of a wall's colour where the wall has not been seen."""


@dataclass(frozen=True, eq=False)
class BelievedRooms:
    """What a predictor believed at a snapshot.

    Attributes:
        predictor: Who believed it.
        coverage: Share of the floor that was known, 0..1.
        image: uint8 (h, w, 3) RGB, y up.
    """

    predictor: str
    coverage: float
    image: Bytes

    @property
    def uri(self) -> str:
        """The picture as a data URI."""
        return png_uri(self.image)


@checks_arguments
def draw_believed_rooms(snapshot: Snapshot, rooms: RoomLabels) -> Bytes:
    """The known map with the predicted rooms, seen parts strong, hidden ones pale; frontiers are purple.

    A room has the colour of the true room that it has most seen cells of, so that pictures of different
    predictors can be compared; true walls that nobody has seen are faint.

    Returns:
        uint8 (h, w, 3) RGB, y up.
    """
    cells, truth = snapshot.decision.grid.cells, snapshot.truth.raster
    image = np.full((*cells.shape, 3), palette.CANVAS, np.uint8)
    ids = np.where(rooms.passable, rooms.room_ids, 0)
    fills = fills_of_rooms(truth.room_ids, truth.resolution)
    seen = cells == FREE
    true_rooms = shared_cells(ids[seen], truth.room_ids[seen]).argmax(axis=1)
    for room in np.unique(ids[seen & (ids > 0)]).tolist():
        true_room = true_rooms[room]
        red, green, blue = fills[true_room].tolist() if true_room else palette.room_colour(0)
        colour = (red, green, blue)
        image[(ids == room) & seen] = colour
        if room != rooms.rest:
            image[(ids == room) & (cells == UNKNOWN)] = palette.mix(palette.CANVAS, colour, HIDDEN)
    image[(ids == 0) & seen] = palette.FREE
    unseen_wall = (cells == UNKNOWN) & truth.occupied & with_neighbours(truth.free)
    image[unseen_wall] = palette.mix(palette.CANVAS, palette.WALL, FAINT)
    image[cells == OCCUPIED] = palette.WALL
    image[tuple(snapshot.decision.clusters.cells.T)] = palette.PURPLE
    part = image[window(cells != UNKNOWN, round(1.0 / snapshot.decision.grid.resolution))]
    scale = max(1, round(WIDTH / max(part.shape[:2])))
    large = cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    return np.ascontiguousarray(large[::-1], np.uint8)


@checks_arguments
def write_in_the_loop_report(
    out: Path,
    scores: Sequence[LoopScore],
    pictures: Sequence[BelievedRooms],
    *,
    facts: dict[str, Any],
    failed: Sequence[FailedRuns] = (),
) -> list[Path]:
    """Write in-the-loop.html, in-the-loop.csv and pictures/*.png into a folder.

    Args:
        out: The folder; made when missing.
        scores: One a predictor.
        pictures: What predictors believed, by coverage and predictor.
        facts: "command", "plans", "buildings", "sensors", "starts", "plan" (the one in the pictures).
        failed: The agents of which runs failed.

    Returns:
        The files written, the page first.
    """
    written = [out / "in-the-loop.html", out / "in-the-loop.csv"]
    write_csv(written[1], [_row(score) for score in scores])
    for shown in pictures:
        path = out / "pictures" / f"{safe_name(shown.predictor)}_{shown.coverage:.0%}.png".replace("%", "")
        write_atomically(path, encode_png(shown.image))
        written.append(path)
    coverages = sorted({shown.coverage for shown in pictures})
    by_place = {(shown.predictor, shown.coverage): shown for shown in pictures}
    view = {
        "scores": scores,
        "coverages": coverages,
        "pictures": by_place,
        "baseline": BASELINE,
        "driver": DRIVER,
        "failed": failed,
    }
    write_atomically(written[0], render("studies/in_the_loop.html", **view, **facts))
    return written


def _row(score: LoopScore) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for key, value in vars(score).items():
        if isinstance(value, Interval):
            row |= value.as_columns(key)
        elif key in ("d95", "d99"):
            row |= dict.fromkeys(NO_INTERVAL.as_columns(key))
        else:
            row[key] = value
    return row
