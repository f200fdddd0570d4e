"""Pictures of decisive decisions: where the robot went, and where it would have gone without the layout."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.benchmark.counterfactual import DecisiveDecision
from layoutexplore.benchmark.rows import Row
from layoutexplore.drawing import palette
from layoutexplore.errors import LayoutExploreError
from layoutexplore.grids.arrays import Bytes, Floats, Ints, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, Cell
from layoutexplore.grids.morphology import inflate
from layoutexplore.planning.shortest_paths import descend, geodesic_distances
from layoutexplore.report.plots import line_path
from layoutexplore.report.scale_bars import PlacedScaleBar, place_scale_bar, scale_bar
from layoutexplore.report.templates import NBSP, number, png_uri

SHOWN = 345.0, 420.0
"""The most pixels of a page, in width and height, that a picture has."""

MARK_WEIGHT = 20.0
"""How many cells of the map a cell under a mark or a label is worth, where a scale bar may lie."""

MARGIN, LEAST_SIDE = 2.5, 12.0
"""Metres around what matters, and the least side of a picture."""

LEAST_ASPECT = 0.8
"""The shorter side of a picture over the longer one, where the plan is large enough."""

LABELS = 10
"""Frontiers whose expected area is written into the picture: those nearest to the robot."""

_TEXT = 16
"""Room for the text of a label, in hundredths of a picture's longer side."""

RADIUS = 0.2
"""Metres from walls at which paths are drawn where there is room."""

Place = Callable[[tuple[float, float]], tuple[float, float]]
"""From (row, column) in the grid to (x, y) in the picture."""


@dataclass(frozen=True)
class Label:
    """A frontier with what was said of it, in cells from the top left of the picture.

    The text stands `before` it or behind.
    """

    x: float
    y: float
    text: str
    colour: str
    before: bool


@dataclass(frozen=True)
class DecisionPicture:
    """A decisive decision, ready to be shown."""

    row: Row
    decision: DecisiveDecision
    image: str
    width: int
    height: int
    unit: float
    robot: tuple[float, float]
    chosen: tuple[float, float]
    given_up: tuple[float, float]
    path: str
    path_without: str
    labels: tuple[Label, ...]
    scale: PlacedScaleBar
    title: str
    said: str
    outcome: str


def decision_picture(
    row: Row, decision: DecisiveDecision, occupied: Mask, resolution: float
) -> DecisionPicture:
    """Draw a decisive decision.

    Args:
        row: The run.
        decision: The decision.
        occupied: bool (rows, cols), the floor plan's cells in the frame of the grid.
        resolution: Metres per cell.
    """
    paths = [_cells_walked(decision, goal, resolution) for goal in (decision.chosen, decision.given_up)]
    points = np.concatenate([*paths, [decision.here, decision.chosen, decision.given_up]])
    top, left, height, width = _window(points, occupied.shape, resolution)
    image = _map(decision, occupied)[top : top + height, left : left + width]

    def place(cell: tuple[float, float]) -> tuple[float, float]:
        return round(cell[1] - left + 0.5, 2), round(height - (cell[0] - top) - 0.5, 2)

    labels = _labels(decision, place, (width, height))
    marks = robot, chosen, given_up = place(decision.here), place(decision.chosen), place(decision.given_up)
    return DecisionPicture(
        row=row,
        decision=decision,
        image=png_uri(np.ascontiguousarray(image[::-1])),
        width=width,
        height=height,
        unit=max(width, height) / 100,
        robot=robot,
        chosen=chosen,
        given_up=given_up,
        path=_path(paths[0], place),
        path_without=_path(paths[1], place),
        labels=labels,
        scale=place_scale_bar(scale_bar(width, resolution), _weight(image[::-1], labels, marks), SHOWN),
        title=f"{row.plan}, {row.sensor}, after {number(decision.distance, 0)}{NBSP}m",
        said=_said(decision),
        outcome=_outcome(decision),
    )


def _window(
    points: NDArray[np.integer], shape: tuple[int, ...], resolution: float
) -> tuple[int, int, int, int]:
    """First row and column, height and width of the part of the map around some cells int (n, 2)."""
    found = []
    spans = points.max(axis=0) - points.min(axis=0) + 2 * MARGIN / resolution
    least = max(LEAST_SIDE / resolution, LEAST_ASPECT * float(spans.max()))
    for axis in (0, 1):
        low, high = int(points[:, axis].min()), int(points[:, axis].max())
        spare = max(MARGIN / resolution, (least - (high - low)) / 2)
        low, high = max(math.floor(low - spare), 0), min(math.ceil(high + spare), shape[axis])
        found.append((low, high - low))
    return found[0][0], found[1][0], found[0][1], found[1][1]


def _area(area: float) -> str:
    """Square metres to a decimal.

    What is just under a whole number is not rounded up to it: that is where the threshold lies.

    Example:
        >>> _area(0.9999), _area(3.14)
        ('0.9', '3.1')
    """
    return number(math.floor(10 * area) / 10 if area < 1 else area, 1)


def _map(decision: DecisiveDecision, occupied: Mask) -> Bytes:
    """The floor plan with what is known of it and the frontiers by class, uint8 (rows, cols, 3).

    Row 0 has the lowest y.
    """
    image = np.full((*occupied.shape, 3), palette.CANVAS, np.uint8)
    image[~occupied] = palette.UNSEEN
    row, col = decision.corner
    part = image[row : row + decision.cells.shape[0], col : col + decision.cells.shape[1]]
    part[decision.cells == FREE] = palette.FREE
    part[decision.cells == OCCUPIED] = palette.WALL
    for k, (closed, _, _, _) in enumerate(decision.judged.tolist()):
        rows, cols = decision.members[decision.offsets[k] : decision.offsets[k + 1]].T
        image[rows, cols] = palette.CLOSED if closed else palette.OPEN
    return image


def _cells_walked(decision: DecisiveDecision, goal: tuple[int, int], resolution: float) -> Ints:
    """Cells int64 (n, 2) of a path to a goal over what was known; a straight line where there is none."""
    corner = np.array(decision.corner)
    here, there = (Cell(*map(int, np.array(place) - corner)) for place in (decision.here, goal))
    free = np.ascontiguousarray(decision.cells == FREE)
    for world in (free & ~inflate(decision.cells == OCCUPIED, RADIUS, resolution), free):
        open_world = world.copy()
        open_world[here] = open_world[there] = True
        try:
            distances = geodesic_distances(open_world, here, resolution)
            if np.isfinite(distances[there]):
                steps: Ints = descend(distances, open_world, there).astype(np.int64) + corner
                return steps
        except LayoutExploreError:
            continue
    return np.array([decision.here, goal], np.int64)


def _path(cells: Ints, place: Place) -> str:
    kept = cells[::2].tolist() + cells[-1:].tolist()
    return line_path(place((float(row), float(col))) for row, col in kept)


def _labels(decision: DecisiveDecision, place: Place, size: tuple[int, int]) -> tuple[Label, ...]:
    """What was said of the frontiers nearest the robot, and of the one that was given up."""
    middles = [
        decision.members[a:b].mean(axis=0)
        for a, b in zip(decision.offsets[:-1], decision.offsets[1:], strict=True)
    ]
    away = np.hypot(*(np.array(middles) - decision.here).T)
    away[decision.without] = -1.0
    labels: list[Label] = []
    for k in np.argsort(away, kind="stable").tolist():
        x, y = place((float(middles[k][0]), float(middles[k][1])))
        unit = max(size) / 100
        before = x > size[0] - _TEXT * unit
        left = x - before * _TEXT * unit
        crowded = any(
            abs(left - (o.x - o.before * _TEXT * unit)) < _TEXT * unit and abs(y - o.y) < 4 * unit
            for o in labels
        )
        if not (0 <= x <= size[0] and 5 * unit <= y <= size[1]) or crowded or len(labels) >= LABELS:
            continue
        closed, area = decision.judged[k, :2].tolist()
        text = f"{_area(area)}{NBSP}m²" if closed else "open"
        colour = palette.mix(palette.CLOSED if closed else palette.OPEN, palette.BLACK, 0.35)
        labels.append(Label(x, y, text, palette.to_hex(colour), before))
    return tuple(labels)


def _weight(image: Bytes, labels: tuple[Label, ...], marks: Sequence[tuple[float, float]]) -> Floats:
    """What a scale bar must not hide, float64 (rows, cols): what is drawn on the map, marks and labels."""
    weight = np.where((image == np.array(palette.CANVAS, np.uint8)).all(axis=2), 0.0, 1.0)
    rows, cols = weight.shape
    unit = max(rows, cols) / 100
    boxes = [(x - 3 * unit, x + 3 * unit, y - 3 * unit, y + 3 * unit) for x, y in marks]
    for label in labels:
        left = label.x - label.before * _TEXT * unit
        boxes.append((left, left + _TEXT * unit, label.y - 5 * unit, label.y))
    for box in boxes:
        x0, x1, y0, y1 = (max(int(at), 0) for at in box)
        weight[y0 : y1 + 1, x0 : x1 + 1] += MARK_WEIGHT
    return weight


def _said(decision: DecisiveDecision) -> str:
    """What was predicted of the frontier that was given up, and what is true."""
    closed, area, true_closed, true_area = decision.judged[decision.without].tolist()
    predicted = f"{_area(area)}{NBSP}m² left in its room" if closed else "it leads on"
    true = f"{_area(true_area)}{NBSP}m² left" if true_closed else "it leads on"
    stake = f"{number(decision.stake, 0)}{NBSP}m of detour at stake."
    return f"The frontier passed over: predicted {predicted}, in truth {true}. {stake}"


def _outcome(decision: DecisiveDecision) -> str:
    """What came of it."""
    if math.isnan(decision.seen_after):
        return (
            "The robot went back there later, in vain."
            if decision.came_back
            else "It was never needed: the run ended without it."
        )
    metres = f"{number(decision.seen_after, 0)}{NBSP}m later"
    return (
        f"The robot came back for it {metres}."
        if decision.came_back
        else f"It was seen in passing, {metres}."
    )
