"""The page of an evaluation of half-seen rooms.

It shows every predictor by stratum, calibration, areas, the best and the worst rooms.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.partial_rooms import Item, RoomScore, Scores, predicted_hidden
from layoutexplore.evaluation.partial_rooms_summary import FrontierLine, PredictorSummary, RoomLine
from layoutexplore.files import write_atomically, write_csv
from layoutexplore.grids.arrays import Bytes
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.metrics.statistics import NO_INTERVAL, Interval
from layoutexplore.predictors.protocol import RoomLabels
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.report.charts import calibration_chart, line_chart, root_scatter
from layoutexplore.report.studies.in_the_loop import WIDTH
from layoutexplore.report.templates import NBSP, png_uri, render

PICTURES = 6
"""Rooms drawn of the best, and of the worst."""

LEAST_HIDDEN = 2.0
"""Square metres: rooms with less left are not drawn."""

MARGIN = 1.5
"""Metres around a room in its picture."""

_BOUNDS = ("none", "oracle")
"""Predictors that show the least and the most there is to reach."""


@dataclass(frozen=True, eq=False)
class RoomPicture:
    """A scored room and its picture, uint8 (h, w, 3) RGB."""

    score: RoomScore
    image: Bytes

    @property
    def uri(self) -> str:
        """The picture as a data URI."""
        return png_uri(self.image)


class Gallery:
    """Keeps the pictures of the best and the worst predicted rooms of one predictor; a `Watch`.

    Args:
        predictor: Whose rooms.
        count: How many of each.
    """

    def __init__(self, predictor: str, count: int = PICTURES) -> None:
        self.predictor = predictor
        self._count = count
        self._best: list[RoomPicture] = []
        self._worst: list[RoomPicture] = []

    def __call__(self, snapshot: Snapshot, item: Item, rooms: RoomLabels, score: RoomScore) -> None:
        """Keep a room if it is among the best or the worst so far."""
        if score.predictor != self.predictor or score.true_remaining < LEAST_HIDDEN:
            return
        for kept, sign in ((self._best, -1), (self._worst, 1)):
            key = sign * score.hidden_iou
            same = next((p for p in kept if (p.score.plan, p.score.room) == (score.plan, score.room)), None)
            rival = same or (kept[-1] if len(kept) == self._count else None)
            if rival and sign * rival.score.hidden_iou <= key:
                continue
            if rival:
                kept.remove(rival)
            kept.append(RoomPicture(score, draw_room(snapshot, item, rooms)))
            kept.sort(key=lambda p: sign * p.score.hidden_iou)

    @property
    def best(self) -> list[RoomPicture]:
        """The best rooms, the very best first."""
        return list(self._best)

    @property
    def worst(self) -> list[RoomPicture]:
        """The worst rooms that are not among the best, the very worst first."""
        taken = {(p.score.plan, p.score.room) for p in self._best}
        return [p for p in self._worst if (p.score.plan, p.score.room) not in taken]


@checks_arguments
def draw_room(snapshot: Snapshot, item: Item, rooms: RoomLabels) -> Bytes:
    """A half-seen room with its prediction, uint8 (h, w, 3) RGB, y up.

    The map as it was known; of the room what was seen, what is predicted rightly, wrongly, and not at all;
    its true outline as a dark line, the frontiers coloured.
    """
    cells, resolution = snapshot.decision.grid.cells, snapshot.truth.raster.resolution
    found = predicted_hidden(cells, item, rooms)
    hidden = item.mask & ~item.seen
    part = window(item.mask | found, math.ceil(MARGIN / resolution))
    image = np.full((*cells.shape, 3), palette.CANVAS, np.uint8)
    image[cells == FREE] = palette.FREE
    for mask, colour in (
        (item.seen, palette.SEEN),
        (found & hidden, palette.RIGHT),
        (found & ~item.mask, palette.WRONG),
        (hidden & ~found, palette.MISSED),
    ):
        image[mask] = colour
    image[cells == OCCUPIED] = palette.WALL
    image[tuple(snapshot.decision.clusters.cells.T)] = palette.PURPLE
    scale = max(1, round(WIDTH / max(image[part].shape[:2])))
    large, outline = (
        np.asarray(cv2.resize(a, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST), np.uint8)
        for a in (image[part], item.mask[part].astype(np.uint8))
    )
    contours, _ = cv2.findContours(outline, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(large, contours, -1, palette.INK, max(1, scale // 3))
    return np.ascontiguousarray(large[::-1])


@checks_arguments
def write_partial_rooms_report(
    out: Path, scores: Scores, summary: Mapping[str, PredictorSummary], gallery: Gallery, *, command: str
) -> list[Path]:
    """Write report.html, rooms.csv, frontiers.csv, summary.csv and pictures/*.png into a folder.

    Args:
        out: The folder; made when missing.
        scores: Every score.
        summary: What `summarise_partial_rooms` made of them.
        gallery: The rooms to show.
        command: Noted on the page.

    Returns:
        The files written, the page first.
    """
    (out / "pictures").mkdir(parents=True, exist_ok=True)
    tables = {
        "rooms.csv": [dataclasses.asdict(row) for row in scores.rooms],
        "frontiers.csv": [
            dataclasses.asdict(row)
            # every digit: rounded, an area just below 1 m2 would no longer be one that is left over
            | {"area": str(row.area), "true_area": str(row.true_area)}
            | {"leftover": row.leftover, "true_leftover": row.true_leftover}
            for row in scores.frontiers
        ],
        "summary.csv": _flat(summary),
    }
    written = [out / "report.html"]
    for name, rows in tables.items():
        write_csv(out / name, rows)
        written.append(out / name)
    for kind, pictures in (("best", gallery.best), ("worst", gallery.worst)):
        for k, shown in enumerate(pictures, 1):
            path = out / "pictures" / f"{kind}_{k}.png"
            write_atomically(path, encode_png(shown.image))
            written.append(path)
        for k in range(len(pictures) + 1, PICTURES + 1):  # of an earlier study they would pass for this one's
            (out / "pictures" / f"{kind}_{k}.png").unlink(missing_ok=True)
    page = render("studies/partial_rooms.html", **_view(scores, summary, gallery), command=command)
    write_atomically(written[0], page)
    return written


def _view(scores: Scores, summary: Mapping[str, PredictorSummary], gallery: Gallery) -> dict[str, Any]:
    """What the template shows."""
    strata = list(dict.fromkeys(line.explored for found in summary.values() for line in found.rooms))
    coverages = list(dict.fromkeys(line.coverage for found in summary.values() for line in found.frontiers))
    names = list(summary)
    rooms = {name: {line.explored: line for line in summary[name].rooms} for name in names}
    frontiers = {name: {line.coverage: line for line in summary[name].frontiers} for name in names}
    mine = [f for f in scores.frontiers if f.predictor == gallery.predictor]
    areas = [r for r in scores.rooms if r.predictor == gallery.predictor]
    return {
        "names": names,
        "main": gallery.predictor,
        "strata": strata,
        "coverages": coverages,
        "rooms": rooms,
        "frontiers": frontiers,
        "ms": {name: summary[name].ms for name in names},
        "leaders": {m: {s: _leader(rooms, s, m) for s in strata} for m in ("hidden_iou", "iou")},
        "counts": {s: max((rooms[n][s].rooms for n in names if s in rooms[n]), default=0) for s in strata},
        "judged": {
            c: max((frontiers[n][c].frontiers for n in names if c in frontiers[n]), default=0)
            for c in coverages
        },
        "hidden_chart": line_chart(
            _hidden(rooms, strata[1:]), [spell(s) for s in strata[1:]], main=gallery.predictor
        ),
        "mcc_chart": line_chart(
            _mcc(frontiers, coverages[1:]),
            [spell(c) for c in coverages[1:]],
            main=gallery.predictor,
            low=-0.25,
        ),
        "calibration": calibration_chart(
            np.array([f.confidence for f in mine]),
            np.array([f.closed == f.true_closed for f in mine], np.bool_),
        ),
        "areas": root_scatter(
            np.array([r.true_remaining for r in areas]),
            np.array([r.remaining for r in areas]),
            [f"{r.plan}, room {r.room}: {r.remaining:.1f} for {r.true_remaining:.1f} m²" for r in areas],
        ),
        "best": gallery.best,
        "worst": gallery.worst,
        "plans": len({r.plan for r in scores.rooms}),
        "buildings": len({r.building for r in scores.rooms}),
        "sensors": sorted({f.sensor for f in scores.frontiers}),
        "outside": {name: why for name in names if (why := _outside(name))},
        "spell": spell,
        "least_hidden": LEAST_HIDDEN,
    }


def spell(stratum: str) -> str:
    r"""A stratum as it is printed.

    Example:
        >>> spell("25%-50%"), spell("20%"), spell("all")
        ('25–50\xa0%', '20\xa0%', 'all')
    """
    return stratum.replace("%-", "–").replace("%", f"{NBSP}%")


def _outside(name: str) -> str:
    """Why a predictor does not compete; empty if it does."""
    kind = name.partition(":")[0]
    return "bound" if kind in _BOUNDS else "knows a plan" if kind == "prior" else ""


def _leader(rooms: Mapping[str, Mapping[str, RoomLine]], stratum: str, measure: str) -> str:
    """The best predictor of a stratum that competes; empty where there is none."""
    found = {
        name: getattr(lines[stratum], measure)
        for name, lines in rooms.items()
        if stratum in lines and not _outside(name)
    }
    return max(found, key=lambda name: found[name], default="")


def _hidden(lines: Mapping[str, Mapping[str, RoomLine]], strata: Sequence[str]) -> dict[str, list[Interval]]:
    """By predictor and stratum the IoU of hidden parts."""
    return {name: [by[s].hidden if s in by else NO_INTERVAL for s in strata] for name, by in lines.items()}


def _mcc(lines: Mapping[str, Mapping[str, FrontierLine]], strata: Sequence[str]) -> dict[str, list[Interval]]:
    """By predictor and stratum Matthews' correlation, without an interval."""
    values = {name: [by[s].mcc if s in by else math.nan for s in strata] for name, by in lines.items()}
    return {name: [Interval(v, math.nan, math.nan) for v in line] for name, line in values.items()}


def _flat(summary: Mapping[str, PredictorSummary]) -> list[dict[str, Any]]:
    """A row a predictor, part and stratum."""
    rows = []
    for name, found in summary.items():
        for part, lines in (("rooms", found.rooms), ("frontiers", found.frontiers)):
            for line in lines:
                (_, stratum), *measures = dataclasses.asdict(line).items()
                rows += [
                    {"predictor": name, "of": part, "stratum": stratum, "measure": measure, "value": value}
                    for measure, value in measures
                ]
        rows.append({"predictor": name, "of": "time", "stratum": "all", "measure": "ms", "value": found.ms})
    return rows
