"""The figures of the exploration report, as plain shapes in percent of their frame.

Lines and areas are SVG that stretches with the page, with strokes that keep their width; marks and labels are
placed by the page's style in percent. So text has the same size on a telephone and on a large screen.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.benchmark.analysis import Comparison, PooledCurve
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing import palette
from layoutexplore.drawing.labels import label_gap, label_places
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.grids.grid import Pose
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.layout.frame import to_local
from layoutexplore.report.scale_bars import PlacedScaleBar, place_scale_bar, scale_bar
from layoutexplore.report.templates import NBSP, png_uri

RATIO_LIMITS = (0.4, 2.0)
"""The forest plot never shows more than this; ratios outside are marked at its edge."""

_WIDEST_NAME = 40
"""Characters of an agent's name on one line of the forest plot; longer ones are broken, to leave it room."""

_ODD = 1.6
"""Agents beyond this ratio do not stretch the axis."""

_TICKS = (1.0, 0.8, 0.9, 1.2, 0.6, 1.5, 0.5, 0.7, 2.0, 0.4, 1.1, 1.3)
"""Labels in the order in which they are placed where there is room."""

_TICK_GAP = 10.0
"""Least percent of the width between labels."""

PICTURED_PLANS = 4
"""Floor plans on which tracks are drawn: the smallest, the largest, and evenly between."""

_DASHES = ("", "7 3", "2 3", "9 3 2 3")

_PIECES = 40


@dataclass(frozen=True)
class Tick:
    """A labelled place on an axis, in percent."""

    at: float
    label: str


@dataclass(frozen=True)
class ForestRow:
    """One agent in the forest plot; places in percent of the width."""

    comparison: Comparison
    guard: Comparison | None
    place: float
    low: float
    high: float
    guard_place: float | None
    outside: bool


@dataclass(frozen=True)
class ForestPlot:
    """Ratios with their intervals on a logarithmic axis."""

    rows: list[ForestRow]
    ticks: list[Tick]
    one: float
    name_width: int


def forest(comparisons: Sequence[Comparison], metric: str = "d95") -> ForestPlot:
    """The comparisons of one group as a forest plot, best first.

    Args:
        comparisons: All metrics of one group.
        metric: What is shown with its interval; the distance to 99 % is a small mark.
    """
    shown = sorted((c for c in comparisons if c.metric == metric), key=lambda c: c.ratio.estimate)
    guards = {c.agent: c for c in comparisons if c.metric == "d99"}
    usual = [c.ratio for c in shown if c.ratio.estimate < _ODD]
    marks = [c.ratio.estimate for c in guards.values() if c.ratio.estimate < _ODD]
    ends = [v for ratio in usual for v in (ratio.low, ratio.high, ratio.estimate)] + marks
    low = max(RATIO_LIMITS[0], min([0.8, *filter(math.isfinite, ends)]) / 1.03)
    high = min(RATIO_LIMITS[1], max([1.25, *filter(math.isfinite, ends)]) * 1.03)

    def place(ratio: float) -> float:
        return 100 * min(max(math.log(ratio / low) / math.log(high / low), 0.0), 1.0)

    rows = []
    for c in shown:
        left, right = c.ratio.ends
        other = guards.get(c.agent)
        rows.append(
            ForestRow(
                comparison=c,
                guard=other,
                place=place(c.ratio.estimate),
                low=place(left),
                high=place(right),
                guard_place=place(other.ratio.estimate) if other else None,
                outside=not low <= c.ratio.estimate <= high,
            )
        )
    ticks: list[Tick] = []
    for value in _TICKS:
        if low <= value <= high and all(abs(place(value) - tick.at) >= _TICK_GAP for tick in ticks):
            ticks.append(Tick(place(value), f"{value:g}"))
    width = min(max((len(c.agent) for c in shown), default=0), _WIDEST_NAME) + 1
    return ForestPlot(rows, ticks, place(1.0), width)


@dataclass(frozen=True)
class CurveLine:
    """A curve with its band, as SVG paths in a frame of 100 x 100; its end, and where its label stands."""

    name: str
    colour: str
    dash: str
    path: str
    band: str
    cells: int
    end: float
    label_at: float


def curve_lines(
    curves: Sequence[PooledCurve], order: Sequence[str], looks: Mapping[str, Look]
) -> list[CurveLine]:
    """The pooled curves as paths, in the given order of agents."""
    by_agent = {curve.agent: curve for curve in curves}
    shown = [by_agent[agent] for agent in order if agent in by_agent]
    ends = [100 * (1 - float(curve.mean[-1])) for curve in shown]
    lines = []
    for curve, end, label_at in zip(shown, ends, label_places(ends, label_gap(len(ends))), strict=True):
        x = (100 * curve.x / curve.x[-1]).tolist()
        mean, low, high = (
            list(zip(x, (100 * (1 - y)).tolist(), strict=True)) for y in (curve.mean, curve.low, curve.high)
        )
        band = f"{line_path(high + low[::-1])} Z"
        look = looks[curve.agent]
        lines.append(
            CurveLine(
                curve.agent, *look, line_path(mean), band, curve.cells, round(end, 2), round(label_at, 2)
            )
        )
    return lines


Look = tuple[str, str]
"""Colour, as CSS writes it, and dashes of a line."""


def agent_looks(agents: Sequence[str], baseline: str) -> dict[str, Look]:
    """One look an agent, the same in every chart of a page: the baseline is black.

    Example:
        >>> agent_looks(["tour", "nearest"], "nearest")
        {'tour': ('#0072b2', ''), 'nearest': ('#000000', '')}
    """
    looks, k = {}, 0
    for agent in dict.fromkeys(agents):
        colour, dash = (palette.BLACK, "") if agent == baseline else agent_look(k)
        k += agent != baseline
        looks[agent] = (palette.to_hex(colour), dash)
    return looks


def agent_look(k: int) -> tuple[palette.Colour, str]:
    """Colour and dashes of the k-th agent."""
    colours = [colour for colour in palette.QUALITATIVE if colour != palette.BLACK]
    return colours[k % len(colours)], _DASHES[(k // len(colours)) % len(_DASHES)]


@dataclass(frozen=True)
class TrackPicture:
    """A track in pieces from the start to the end, in cells from the top left of the picture."""

    pieces: list[tuple[str, str]]
    start: tuple[float, float]
    end: tuple[float, float]


def floor_picture(occupied: Mask) -> str:
    """The floor as a data URI: white where free, dark where a wall bounds it, pale elsewhere.

    The top row has the highest y.
    """
    free = ~occupied
    grey = np.full(occupied.shape, 236, np.uint8)
    grey[free] = 255
    grey[occupied & with_neighbours(free, 2)] = 88
    return png_uri(np.ascontiguousarray(grey[::-1]))


@dataclass(frozen=True)
class Picture:
    """A track on a floor plan; `seen` says after how many metres the floor was seen."""

    caption: str
    seen: str
    row: Row
    floor: str
    width: int
    height: int
    track: TrackPicture
    scale: PlacedScaleBar

    @property
    def wide(self) -> bool:
        """Whether the plan needs a wide frame to be seen."""
        return _is_wide(self.width, self.height)


def pictures_of_tracks(
    folder: ResultsFolder, rows: Sequence[Row], baseline: str, knowing: Collection[str], level: str
) -> list[tuple[str, list[Picture]]]:
    """The tracks of the best agent, the baseline, the worst and one that knows the plan, on a few plans.

    Args:
        folder: The results.
        rows: All runs.
        baseline: The agent to compare with.
        knowing: The agents that know the plan.
        level: The distance that ranks, such as d95; the whole distance does where it is empty.
    """
    good = [row for row in rows if not row.error]
    if not good:
        return []
    sensor = good[0].sensor
    areas = {row.plan: row.target_area for row in good if row.sensor == sensor}
    plans = sorted(areas, key=lambda plan: (areas[plan], plan))
    count = min(PICTURED_PLANS, len(plans))
    chosen = [plans[round(k * (len(plans) - 1) / max(count - 1, 1))] for k in range(count)]
    found = []
    for plan in chosen:
        start = min(row.start for row in good if row.plan == plan and row.sensor == sensor)
        here = [row for row in good if row.cell == (plan, start, sensor)]
        metres = {row: getattr(row, level or "distance") for row in here}
        here.sort(key=lambda row: (math.isnan(metres[row]), metres[row], row.agent))
        honest = [row for row in here if row.agent not in knowing]
        picks = {
            "best": honest[:1],
            "baseline": [row for row in here if row.agent == baseline],
            "worst": honest[-1:],
            "knows the plan": [row for row in here if row.agent in knowing][:1],
        }
        captions: dict[Row, list[str]] = {}
        for caption, picked in picks.items():
            is_said = len(honest) > 1 or caption not in ("best", "worst")  # of one alone, it is neither
            for row in picked:
                captions.setdefault(row, []).extend([caption] * is_said)
        cards = [_picture(folder, ", ".join(c), row, level) for row, c in captions.items()]
        found.append((f"{plan}, start {start}, {sensor}", cards))
    return found


def _picture(folder: ResultsFolder, caption: str, row: Row, level: str) -> Picture:
    occupied, frame = folder.raster(row.plan)
    _, track = folder.episode(row)
    rows, cols = occupied.shape
    way = track_picture(track, frame, rows)
    shown = WIDE_SHOWN if _is_wide(cols, rows) else SHOWN
    scale = place_scale_bar(scale_bar(cols, float(frame[0])), _weight(occupied, way), shown)
    seen = ""
    if level:
        reached = getattr(row, level.replace("d", "reached"))
        share = f"{level[1:]}{NBSP}%"
        seen = f"{getattr(row, level):.0f} m to {share}" if reached else f"{share} not reached"
    return Picture(caption, seen, row, floor_picture(occupied), cols, rows, way, scale)


SHOWN, WIDE_SHOWN = (243.0, 340.0), (525.0, 340.0)
"""The most pixels of a page, in width and height, that such a picture has; and a wide one."""

END_WEIGHT = 100.0
"""How many cells of floor a cell near either end of a way is worth, where a scale bar may lie."""


def _is_wide(width: int, height: int) -> bool:
    return width > 2.2 * height


def _weight(occupied: Mask, way: TrackPicture) -> Floats:
    """What a scale bar must not hide, float64 (rows, cols), the top row first: floor, and the way's ends."""
    weight = np.where(occupied, 0.0, 1.0)[::-1]
    for x, y in (way.start, way.end):
        row, col = (min(max(int(at), 0), size - 1) for at, size in zip((y, x), weight.shape, strict=True))
        around = max(1, max(weight.shape) // 60)
        weight[max(row - around, 0) : row + around + 1, max(col - around, 0) : col + around + 1] += END_WEIGHT
    return weight


MOST_POINTS = 20_000
"""Points of a way that are drawn: in a picture nobody tells more apart."""


def track_picture(track: Floats, frame: Floats, rows: int) -> TrackPicture:
    """A track (n, 3) as pieces of even length whose colours run along the ramp.

    Args:
        track: Poses in metres.
        frame: (resolution, origin x, origin y, origin theta) of the picture.
        rows: Height of the picture in cells.
    """
    resolution, *origin = frame.tolist()
    step = 1 + len(track) // MOST_POINTS
    track = np.vstack([track[:-1:step], track[-1:]])
    points = to_local(track[:, :2], Pose(*origin)) / resolution
    points[:, 1] = rows - points[:, 1]
    walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    ends = np.linspace(0, walked[-1], _PIECES + 1)
    pieces = []
    for k in range(_PIECES if walked[-1] > 0 else 0):
        inside = (walked > ends[k]) & (walked < ends[k + 1])
        tips = [
            np.array([np.interp(ends[j], walked, points[:, axis]) for axis in (0, 1)]) for j in (k, k + 1)
        ]
        piece = np.vstack([tips[0], points[inside], tips[1]])
        pieces.append((_ramp((k + 0.5) / _PIECES), line_path(piece.tolist())))
    (sx, sy), (ex, ey) = points[0], points[-1]
    return TrackPicture(
        pieces, (round(float(sx), 1), round(float(sy), 1)), (round(float(ex), 1), round(float(ey), 1))
    )


def _ramp(t: float) -> str:
    place = t * (len(palette.RAMP) - 1)
    k = int(place)
    return palette.to_hex(palette.mix(palette.RAMP[k], palette.RAMP[k + 1], place - k))


def line_path(points: Iterable[tuple[float, float]]) -> str:
    """An SVG path through points (x, y), of which y runs downwards; empty where there is none.

    Example:
        >>> line_path([(0, 1), (2.5, 3)])
        'M0.00,1.00 L2.50,3.00'
    """
    path = " L".join(f"{x:.2f},{y:.2f}" for x, y in points)
    return f"M{path}" if path else ""


def heat(ratio: float) -> str:
    """Background for a ratio: blue below 1, orange above, white at 1, full at half and at twice."""
    if not math.isfinite(ratio) or ratio <= 0:
        return "transparent"
    strength = min(1.0, abs(math.log2(ratio)))
    colour = palette.BLUE if ratio < 1 else palette.VERMILLION
    return f"rgba({colour[0]},{colour[1]},{colour[2]},{0.55 * strength:.2f})"
