"""The page of an evaluation of rooms behind closed doors: by building, and map by map beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.closed_doors import PairScore, Score, whole_building
from layoutexplore.files import write_atomically, write_csv
from layoutexplore.grids.arrays import Bytes, Cells, Mask, check_alike
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.maps.closed_door_maps import Triple, read_cells
from layoutexplore.report.templates import png_uri, render

SIDE = 640
"""Most pixels of the longer side of a map in the page; the files have all."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture of a map with its caption."""

    caption: str
    uri: str


@dataclass(frozen=True, eq=False)
class Card:
    """A map on the page."""

    score: PairScore
    panels: tuple[Panel, ...]


@checks_arguments
def draw_map(cells: Cells, new: Mask, truth: Mask) -> Bytes:
    """A map with a prediction, uint8 (rows, cols, 3) RGB.

    Args:
        cells: int8 (rows, cols), what was seen.
        new: bool (rows, cols), cells that are predicted to be free, beyond what was seen.
        truth: bool (rows, cols), cells that are free.
    """
    check_alike("draw_map", cells=cells, new=new, truth=truth)
    image = np.full((*cells.shape, 3), palette.CANVAS, np.uint8)
    hidden = truth & (cells != FREE)
    image[cells == FREE] = palette.FREE
    image[cells == OCCUPIED] = palette.WALL
    image[hidden & ~new] = palette.MISSED
    image[hidden & new] = palette.RIGHT
    image[new & ~truth] = palette.WRONG
    return image


@checks_arguments
def draw_panels(triple: Triple, folder: Path) -> list[tuple[str, Bytes]]:
    """What was seen, the reference's answer, ours and the truth, each with its name.

    Cut to what the truth shows.

    Args:
        triple: The map.
        folder: Holds NAME_k_doors_pred.png.
    """
    cells = read_cells(triple.seen)
    shape = (cells.shape[0], cells.shape[1])
    truth_cells = read_cells(triple.truth, shape)
    truth, seen = truth_cells == FREE, cells == FREE
    nothing = np.zeros_like(seen)
    panels = [("seen", draw_map(cells, nothing, seen))]
    answers = [("reference", triple.reference), ("ours", folder / f"{triple.name}_pred.png")]
    for name, path in answers:
        if path is not None:
            panels.append((name, draw_map(cells, (read_cells(path, shape) == FREE) & ~seen, truth)))
    panels.append(("truth", draw_map(np.where(truth & ~seen, cells, truth_cells), nothing, truth)))
    part = window(truth_cells != UNKNOWN, 8)
    return [(name, np.ascontiguousarray(image[part])) for name, image in panels]


@checks_arguments
def write_closed_doors_report(
    out: Path,
    triples: Sequence[Triple],
    scores: Sequence[PairScore],
    summary: Sequence[Mapping[str, Any]],
    *,
    command: str,
    note: str = "",
) -> list[Path]:
    """Write report.html, maps.csv, summary.csv and pictures/NAME_k_doors.png into the predictions' folder.

    Args:
        out: The folder that holds NAME_k_doors_pred.png.
        triples: The maps.
        scores: Their scores, in the same order.
        summary: What `summarise_closed_doors` made of them.
        command: Noted on the page.
        note: What the prediction was trained on.

    Returns:
        The files written, the page first.
    """
    (out / "pictures").mkdir(parents=True, exist_ok=True)
    write_csv(out / "maps.csv", [_row(score) for score in scores])
    write_csv(out / "summary.csv", summary)
    cards = []
    for triple, score in sorted(
        zip(triples, scores, strict=True), key=lambda pair: (pair[1].ours.iou, pair[0].name)
    ):
        panels = draw_panels(triple, out)
        wide = np.hstack(
            [np.pad(image, ((0, 0), (0, 12), (0, 0)), constant_values=255) for _, image in panels]
        )
        write_atomically(out / "pictures" / f"{triple.name}.png", encode_png(wide[:, :-12]))
        cards.append(
            Card(
                score, tuple(Panel(_caption(name, score), png_uri(_smaller(image))) for name, image in panels)
            )
        )
    overall = {(line["group"], line["method"]): line for line in summary}
    page = render(
        "studies/closed_doors.html",
        summary=summary,
        ours=overall.get(("with a reference", "ours")) or overall["all maps", "ours"],
        reference=overall.get(("with a reference", "reference")),
        cards=cards,
        buildings=len({whole_building(score.building) for score in scores}),
        command=command,
        note=note[:1].upper() + note[1:].rstrip("."),
    )
    write_atomically(out / "report.html", page)
    return [out / "report.html", out / "maps.csv", out / "summary.csv"]


def _caption(name: str, score: PairScore) -> str:
    answer = {"reference": score.reference, "ours": score.ours}.get(name)
    return f"{name}, IoU {answer.iou:.2f}" if answer else name


def _smaller(image: Bytes) -> Bytes:
    """The picture at the size of the page; dark lines stay dark."""
    scale = min(1.0, SIDE / max(image.shape[:2]))
    thin = round(0.75 / scale)
    if thin > 1:  # walls of a pixel would fade to grey
        image = np.asarray(cv2.erode(image, np.ones((thin, thin), np.uint8)), np.uint8)
    size = (max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _row(score: PairScore) -> dict[str, Any]:
    row: dict[str, Any] = {
        "building": score.building,
        "doors": score.doors,
        "hidden_m2": score.hidden_m2,
        "before": score.before,
    }
    for name, answer in (("ours", score.ours), ("reference", score.reference)):
        row |= {f"{name}_{measure}": getattr(answer, measure, None) for measure in Score.__dataclass_fields__}
    return row | {"seconds": score.seconds}
