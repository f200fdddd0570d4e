"""The pictures and the page of a segmentation evaluation: ours against the truth, the worst map first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from layoutexplore.drawing import palette
from layoutexplore.drawing.layouts import INK, UNSEEN
from layoutexplore.drawing.room_fills import fills_of_rooms
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.segmentation import MapScore, in_percent, summarise_segmentation
from layoutexplore.files import safe_name, write_atomically, write_csv
from layoutexplore.grids.arrays import Bytes, Ints, Ints32
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.maps.painted_rooms import Case, read_case
from layoutexplore.metrics.segmentation import HEADINGS, MEASURES, overlap_table
from layoutexplore.report.templates import png_uri, render

UNCLAIMED = (255, 255, 255)


def comparison_picture(case: Case, labels: Ints32, resolution: float) -> Bytes:
    """Segments (left) and true rooms (right) of a map, uint8 RGB, y up.

    Matched segments wear their room's colour.

    Args:
        case: The map.
        labels: int32 (rows, cols), the segments.
        resolution: Metres a pixel where the map's folder does not say it.
    """
    grid, truth, free = read_case(case, resolution)
    found = np.where(free, labels, 0)
    part = window(grid.cells != UNKNOWN, 10)
    ground = np.where(free[..., None], UNCLAIMED, np.where(grid.occupied[..., None], INK, UNSEEN)).astype(
        np.uint8
    )[part]
    sides, fills = [], fills_of_rooms(np.where(free, truth, 0), grid.resolution)
    for values, names in ((found, _matched(found, truth)), (np.where(free, truth, 0), np.arange(len(fills)))):
        colours = np.array(
            [fills[n] if n < len(fills) else palette.room_colour(int(n)) for n in names], np.uint8
        )
        sides.append(np.where((values > 0)[part][..., None], colours[values[part]], ground)[::-1])
    gap = np.full((sides[0].shape[0], 8, 3), 255, np.uint8)
    return _narrowed(np.hstack([sides[0], gap, sides[1]]), 1600)


def _matched(found: Ints32, truth: Ints32) -> Ints:
    """For each segment the room it is matched to, or a number of its own behind those of the rooms."""
    segments, rooms = int(found.max(initial=0)), int(truth.max(initial=0))
    names = np.arange(segments + 1, dtype=np.int64) + rooms
    present = np.unique(found[found > 0])
    overlaps, sizes, room_sizes = overlap_table(found.ravel(), truth.ravel())
    if not overlaps.size:
        return names
    iou = overlaps / (sizes[:, None] + room_sizes[None, :] - overlaps)
    rows, cols = linear_sum_assignment(iou, maximize=True)
    there = np.unique(truth[truth > 0])
    for r, c in zip(rows, cols, strict=True):
        if overlaps[r, c] > 0:
            names[present[r]] = there[c]
    return names


@checks_arguments
def write_segmentation_report(
    out: Path,
    results: Sequence[tuple[Case, MapScore, Ints32]],
    *,
    title: str,
    protocol: str,
    resolution: float,
    command: str,
    failed: Sequence[str] = (),
) -> list[Path]:
    """Write `results.csv`, `pictures/SET_MAP_METHOD.png` (of seed 0) and `report.html` into a folder.

    Args:
        out: The folder; made when missing.
        results: What `evaluate_cases` or `cross_validate_merging` yielded.
        title: Heading of the page.
        protocol: Named on the page.
        resolution: Metres a pixel where a map's folder does not say it.
        command: Noted on the page.
        failed: What is wrong with each map that could not be used.
    """
    rows = [row for _, row, _ in results]
    columns = [field.name for field in fields(MapScore)]
    write_csv(out / "results.csv", [in_percent(row) for row in rows], columns=columns, digits=None)
    pictures = []
    first = [result for result in results if result[1].seed == 0]
    for case, row, labels in sorted(
        first, key=lambda r: (r[1].one_to_one, r[1].folder, r[1].map, r[1].method)
    ):
        picture = comparison_picture(case, labels, resolution)
        name = f"{safe_name(row.folder)}_{safe_name(row.map)}_{safe_name(row.method)}.png"
        write_atomically(out / "pictures" / name, encode_png(picture))
        pictures.append({"row": row, "image": png_uri(_narrowed(picture, 1000))})
    page = render(
        "studies/segmentation.html",
        title=title,
        protocol=protocol,
        resolution=_span([row.m_per_px for row in rows]),
        measures=MEASURES,
        headings=HEADINGS,
        summary=summarise_segmentation(rows),
        pictures=pictures,
        maps=len({(row.folder, row.map) for row in rows}),
        buildings=len({row.building for row in rows}),
        methods=len({row.method for row in rows}),
        command=command,
        failed=failed,
    )
    write_atomically(out / "report.html", page)
    return [out / "report.html", out / "results.csv"]


def _span(scales: Sequence[float]) -> str:
    """The least and the greatest metres a pixel, as one number where they are one."""
    return "\N{EN DASH}".join(dict.fromkeys(f"{value:.3g}" for value in (min(scales), max(scales))))


def _narrowed(picture: Bytes, width: int) -> Bytes:
    """The picture, made smaller where it has more than so many columns."""
    if picture.shape[1] <= width:
        return picture
    height = max(round(picture.shape[0] * width / picture.shape[1]), 1)
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
