"""Doors: from a link between two spaces to an opening at a sensible place of the wall between them.

The wall between two spaces is where the boundary of one runs within the tolerance of the other; it is cut at
its corners into straight (or gently curved) runs. A door stands near the end that the wish names, half a door
frame away from the corner. Closing doors later never cuts off more than the one room behind the door.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.grids.arrays import Floats, Ints, Mask
from layoutexplore.grids.components import components
from layoutexplore.maps.floorplan import Door
from layoutexplore.maps.generator.config import DrawnConfig
from layoutexplore.maps.generator.space_graph import (
    OUTSIDE,
    ROUNDING,
    TOLERANCE,
    AttemptError,
    Link,
    SpaceGraph,
    added,
)

CORNER = math.radians(15.0)
"""A wall that turns by more than this has a corner there."""

NARROWEST = 0.7
"""Least width of an opening, m: a robot of radius 0.2 m passes it at 0.1 m a cell, whatever the angle."""

MOST_BEND = 0.08
"""How far an opening in a curved wall may leave the wall's line, m."""

JAMB = 0.08
"""Least wall between a door and the crossing wall's face, m."""


def wall_runs(a: Polygon, b: BaseGeometry) -> list[Floats]:
    """The runs, float64 (k, 2) each, of a's boundary along b, longest first (m).

    Example:
        >>> (run,) = wall_runs(shapely.box(0, 0, 4, 3), shapely.box(4, 1, 6, 5))
        >>> round(float(np.hypot(*(run[-1] - run[0]))), 2)
        2.03
    """
    return _runs_within(a, _band(b))


def _band(b: BaseGeometry) -> BaseGeometry:
    """What lies within the tolerance of b."""
    b = shapely.remove_repeated_points(b, ROUNDING)  # at such vertices a mitred buffer divides by zero
    return b.buffer(TOLERANCE, join_style="mitre")


def _runs_within(a: Polygon, band: BaseGeometry) -> list[Floats]:
    """The runs of a's boundary within a band, longest first (m)."""
    shared = a.exterior.intersection(band)
    if shared.geom_type != "LineString":
        shared = shapely.line_merge(shapely.multilinestrings(_lines(shared)))
    runs = [run for line in _lines(shared) for run in _split_at_corners(shapely.get_coordinates(line))]
    return sorted((r for r in runs if _length(r) > 4 * TOLERANCE), key=_length, reverse=True)


def _lines(geometry: BaseGeometry) -> list[LineString]:
    """The line strings of any geometry."""
    if isinstance(geometry, LineString):
        return [] if geometry.is_empty else [geometry]
    return [line for part in getattr(geometry, "geoms", ()) for line in _lines(part)]


def _split_at_corners(points: Floats) -> list[Floats]:
    """Parts of a line between its corners."""
    steps = np.diff(points, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.abs((np.diff(heading) + math.pi) % (2 * math.pi) - math.pi)
    cuts = np.flatnonzero(turn > CORNER) + 1
    return [points[i : j + 1] for i, j in zip([0, *cuts], [*cuts, len(points) - 1], strict=True)]


def _length(points: Floats) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def place_doors(
    graph: SpaceGraph, outline: Polygon, config: DrawnConfig, rng: np.random.Generator
) -> list[Door]:
    """All doors of a graph.

    Raises:
        AttemptError: A wanted connection has no wall that is long enough.
    """
    doors: list[Door] = []
    taken: dict[tuple[int, int], list[BaseGeometry]] = {}
    # The outline and the corridors are asked for again and again.
    facade = outline.boundary if outline.interiors else outline.exterior
    band = functools.cache(lambda key: _band(facade if key == OUTSIDE else graph.polygons[key]))
    for link in graph.resolved_links():
        others = taken.setdefault((min(link.a, link.b), max(link.a, link.b)), [])
        span = _span(link, _runs_within(graph.polygons[link.b], band(link.a)), outline, config, rng, others)
        if span is None:
            if link.optional:
                continue
            names = [graph.labels.get(key, "outside") for key in (link.a, link.b)]
            raise AttemptError(
                f"no wall for a {link.kind} between {names[0]} {link.a} and {names[1]} {link.b}"
            )
        others.append(LineString(span).buffer(0.4))
        start, end = ((round(float(x), 3), round(float(y), 3)) for x, y in span)
        doors.append(Door(start=start, end=end, rooms=(link.a, link.b), is_open=link.a != OUTSIDE))
    return doors


def _span(
    link: Link,
    runs: list[Floats],
    outline: Polygon,
    config: DrawnConfig,
    rng: np.random.Generator,
    taken: Sequence[BaseGeometry],
) -> Floats | None:
    """Both ends, float64 (2, 2), of a link's opening on runs of wall; None where no run is long enough."""
    width = _wanted_width(link, config)
    shift = float(rng.choice([0.04, 0.12, 0.25]))
    for run in _by_distance(runs, link):
        margins = _margins(run, outline, config)
        span = _on_run(run, link, width, margins, shift)
        if span is not None and not any(block.intersects(LineString(span)) for block in taken):
            return span
    return None


def _margins(run: Floats, outline: Polygon, config: DrawnConfig) -> tuple[float, float]:
    """Wall to leave at both ends of a run, m: half of the wall that crosses there, and a jamb."""
    at_facade = shapely.distance(outline.boundary, shapely.points(run[[0, -1]])) < 0.2
    first, last = np.where(at_facade, config.exterior_wall, config.interior_wall) / 2 + JAMB
    return float(first), float(last)


def _wanted_width(link: Link, config: DrawnConfig) -> float:
    """Clear width of the opening in metres (infinite: all there is)."""
    factor = {"door": 1.0, "narrow": 0.85, "double": 1.9, "open": math.inf}[link.kind]
    return max(config.door_width * factor, NARROWEST + 0.02)


def _by_distance(runs: list[Floats], link: Link) -> list[Floats]:
    """Runs long enough for any door, nearest to the wanted place, or longest, first."""
    runs = [run for run in runs if _length(run) > NARROWEST + 2 * JAMB]
    if link.near is None:
        return runs
    point = shapely.Point(link.near)
    return sorted(runs, key=lambda run: round(LineString(run).distance(point), 2))


def _on_run(
    run: Floats, link: Link, width: float, margins: tuple[float, float], shift: float
) -> Floats | None:
    """The opening on one run of wall."""
    length = _length(run)
    clear = length - added(margins)
    width = min(width, clear)
    if width < NARROWEST:
        return None
    line = LineString(run)
    low, high = margins[0] + width / 2, length - margins[1] - width / 2
    middle = (low + high) / 2
    if link.near is not None and width < clear:
        if link.kind in ("door", "narrow"):
            low, high = min(low + shift, middle), max(high - shift, middle)
        middle = min(max(line.project(shapely.Point(link.near)), low), high)
    while width > NARROWEST:
        chord = LineString([line.interpolate(middle - width / 2), line.interpolate(middle + width / 2)])
        if chord.interpolate(0.5, normalized=True).distance(line) < MOST_BEND:
            return np.asarray(shapely.get_coordinates(chord), np.float64)
        width *= 0.8
    return None


def door_components(rooms: Sequence[int], doors: Sequence[Door], shut: Mask) -> Ints:
    """Component number int64 (n,) of every room when only the doors that are not shut connect."""
    index = {room: k for k, room in enumerate(rooms)}
    pairs = [
        (index[d.rooms[0]], index[d.rooms[1]])
        for d, s in zip(doors, shut, strict=True)
        if d.rooms[0] != OUTSIDE and not s
    ]
    first, second = np.array(pairs, np.int64).reshape(-1, 2).T
    return components(first, second, len(rooms))


def choose_closed(
    rooms: Sequence[int], doors: Sequence[Door], share: float, rng: np.random.Generator
) -> list[int]:
    """Indices of inner doors to shut so that whatever gets cut off is a single room each time.

    Args:
        rooms: Room ids.
        doors: All doors; those to the outside are left alone.
        share: Of the inner doors, 0-1; fewer where the rule allows no more.
        rng: Chooses among them.
    """
    inner = [k for k, door in enumerate(doors) if door.rooms[0] != OUTSIDE]
    shut = np.zeros(len(doors), np.bool_)
    wanted = round(share * len(inner))
    for k in rng.permutation(inner):
        if shut.sum() >= wanted:
            break
        shut[k] = True
        sizes = np.bincount(door_components(rooms, doors, shut))
        if (sizes > 1).sum() > 1:
            shut[k] = False
    return np.flatnonzero(shut).tolist()
