"""How well half-seen rooms and frontiers are predicted (Luperto et al. 2019 and 2021).

Every predictor answers the same snapshots of explorations. Items are true rooms seen to 5-95 % that hold a
frontier of half a metre or more; the predicted room is the one that holds most of the room's frontier cells,
so nothing is stretched. A room without a prediction counts as its seen part. Frontiers are compared by class,
and by the decision that saves metres: closed, with less than 1 m2 left.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from layoutexplore.errors import ConfigError, checks_arguments
from layoutexplore.frontiers.answers import completed, saying_where
from layoutexplore.frontiers.classes import LITTLE_LEFT, true_classes
from layoutexplore.frontiers.decision import Decision, Privileged
from layoutexplore.grids.arrays import Cells, Ints32, Mask, check_alike
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.predictors import make_room_predictor
from layoutexplore.predictors.protocol import RoomLabels, RoomPredictor
from layoutexplore.predictors.snapshot import Snapshot

SEEN = (0.05, 0.95)
"""Shares of a room that make it an item."""

FRONTIER_MIN = 0.5
"""Metres of frontier that an item holds at least."""


@dataclass(frozen=True, kw_only=True)
class RoomScore:
    """One predicted room.

    Attributes:
        plan: Floor plan.
        building: Floors of one building share it.
        sensor: Sensor.
        seed: Of the start: those of one plan and sensor tell its explorations apart.
        coverage: Of the snapshot.
        predictor: Who predicted.
        room: Id of the true room.
        explored: Share of the room that was seen, 0..1.
        iou: Of the room, what is seen included.
        hidden_iou: Of predicted minus seen against true minus seen.
        log_area: ln(predicted area / true area): above 0 is too large.
        boundary: Mean distance in metres between the outlines, both ways.
        remaining: Predicted unseen area in square metres.
        true_remaining: True unseen area.
    """

    plan: str
    building: str
    sensor: str
    seed: int
    coverage: float
    predictor: str
    room: int
    explored: float
    iou: float
    hidden_iou: float
    log_area: float
    boundary: float
    remaining: float
    true_remaining: float


@dataclass(frozen=True, kw_only=True)
class FrontierScore:
    """One judged frontier; areas in m2, `confidence` is the stated probability that the class is right.

    `x` and `y` are its middle in metres, `seed` is that of the start.
    """

    plan: str
    building: str
    sensor: str
    seed: int
    coverage: float
    predictor: str
    x: float
    y: float
    closed: bool
    true_closed: bool
    area: float
    true_area: float
    confidence: float

    @property
    def leftover(self) -> bool:
        """Judged closed with less than 1 m2 left."""
        return self.closed and self.area < LITTLE_LEFT

    @property
    def true_leftover(self) -> bool:
        """Closed with less than 1 m2 left."""
        return self.true_closed and self.true_area < LITTLE_LEFT


@dataclass(frozen=True, eq=False)
class Scores:
    """All rooms and frontiers, and the milliseconds of every prediction by predictor."""

    rooms: list[RoomScore]
    frontiers: list[FrontierScore]
    milliseconds: dict[str, list[float]]

    def extend(self, other: Scores) -> None:
        """Add the scores of other snapshots."""
        self.rooms.extend(other.rooms)
        self.frontiers.extend(other.frontiers)
        for predictor, times in other.milliseconds.items():
            self.milliseconds.setdefault(predictor, []).extend(times)


@checks_arguments
def score_predictors(
    snapshots: Iterable[Snapshot],
    predictors: Sequence[object] | Mapping[str, object],
    watch: Watch | None = None,
) -> Scores:
    """Ask every predictor about every snapshot.

    Args:
        snapshots: What is asked.
        predictors: Who is asked, as `make_predictor` takes or makes them: names, or what has
            `rooms(decision)`; by what scores call them, or each by its own name.
        watch: Told of every room that is scored, to draw some.

    Raises:
        ConfigError: Two predictors have one name, or one is none.
        UnknownNameError: There is no predictor of a name.
        OwnCodeError: A user's own predictor cannot be loaded.
    """
    given = predictors.values() if isinstance(predictors, Mapping) else predictors
    made = [make_room_predictor("none" if one is None else one) for one in given]
    names = predictors if isinstance(predictors, Mapping) else [predictor.name for predictor in made]
    named = dict(zip(names, made, strict=True))
    if len(named) < len(made):
        raise ConfigError("two of the predictors have one name: give them by names that tell them apart")
    scores = Scores([], [], {name: [] for name in named})
    for snapshot in snapshots:
        items = find_items(snapshot)
        for name, predictor in named.items():
            with asking(predictor, name, snapshot):
                begin = time.perf_counter()
                judged = completed(snapshot.decision, predictor)
                scores.milliseconds[name].append(1000 * (time.perf_counter() - begin))
                scores.frontiers.extend(_score_frontiers(snapshot, judged, name))
                rooms = predictor.rooms(snapshot.decision)
                for item in items:
                    scores.rooms.append(_score_room(snapshot, item, rooms, name))
                    if watch:
                        watch(snapshot, item, rooms, scores.rooms[-1])
    return scores


@contextmanager
@checks_arguments
def asking(predictor: RoomPredictor, name: str, snapshot: Snapshot) -> Iterator[None]:
    """Inside the block a predictor, which is shown the plan if it asks for it, is asked about a snapshot.

    What fails says of whom, and where.
    """
    seen = f"{100 * snapshot.coverage:.0f} % of {snapshot.plan!r} seen by {snapshot.sensor!r}"
    with saying_where(lambda: f"predictor {name!r}, {seen}, start {snapshot.seed}"):
        if isinstance(predictor, Privileged):
            predictor.reveal(snapshot.truth)
        yield


@dataclass(frozen=True, eq=False)
class Item:
    """A true room seen in part.

    Attributes:
        room: Its id.
        mask: bool (rows, cols), its free cells.
        seen: bool (rows, cols), those that are known.
        frontier: int32 (n, 2), its frontier cells.
    """

    room: int
    mask: Mask
    seen: Mask
    frontier: Ints32


Watch = Callable[[Snapshot, Item, RoomLabels, RoomScore], None]
"""Told of a scored room: the snapshot, the true room, the predicted rooms, and the score."""


@checks_arguments
def find_items(snapshot: Snapshot) -> list[Item]:
    """The true rooms of a snapshot that are seen in part and hold a frontier."""
    cells, raster = snapshot.decision.grid.cells, snapshot.truth.raster
    ids = np.where(raster.free, raster.room_ids, 0)
    total = np.bincount(ids.ravel())
    share = np.bincount(ids[cells != UNKNOWN], minlength=len(total)) / np.maximum(total, 1)
    members = snapshot.decision.clusters.cells
    owners = raster.room_ids[members[:, 0], members[:, 1]]
    length = np.bincount(owners, minlength=len(total)) * raster.resolution
    partial = (share >= SEEN[0]) & (share <= SEEN[1]) & (length >= FRONTIER_MIN - 1e-9)
    items = []
    for room in np.flatnonzero(partial[1:]) + 1:
        mask = ids == room
        items.append(Item(int(room), mask, mask & (cells != UNKNOWN), members[owners == room]))
    return items


def _score_room(snapshot: Snapshot, item: Item, rooms: RoomLabels, predictor: str) -> RoomScore:
    resolution = snapshot.truth.raster.resolution
    found = predicted_hidden(snapshot.decision.grid.cells, item, rooms)
    hidden = item.mask & ~item.seen
    whole = item.seen | found
    return RoomScore(
        **_origin(snapshot, predictor),
        room=item.room,
        explored=float(item.seen.sum() / item.mask.sum()),
        iou=_iou(whole, item.mask),
        hidden_iou=_iou(found, hidden),
        log_area=float(np.log(whole.sum() / item.mask.sum())),
        boundary=boundary_distance(whole, item.mask) * resolution,
        remaining=float(found.sum()) * resolution**2,
        true_remaining=float(hidden.sum()) * resolution**2,
    )


def _origin(snapshot: Snapshot, predictor: str) -> dict[str, Any]:
    """What was asked, and who: the first fields of every score."""
    names = ("plan", "building", "sensor", "seed", "coverage")
    return {name: getattr(snapshot, name) for name in names} | {"predictor": predictor}


@checks_arguments
def predicted_hidden(cells: Cells, item: Item, rooms: RoomLabels) -> Mask:
    """Unknown cells of the predicted room that holds most of the item's frontier cells."""
    owners = rooms.room_ids[item.frontier[:, 0], item.frontier[:, 1]]
    owners = owners[owners > 0]
    if len(owners) == 0:
        return np.zeros(cells.shape, np.bool_)
    room = np.bincount(owners).argmax()
    return np.asarray((rooms.room_ids == room) & rooms.passable & (cells == UNKNOWN))


def _iou(a: Mask, b: Mask) -> float:
    return int(np.count_nonzero(a & b)) / max(int(np.count_nonzero(a | b)), 1)


@checks_arguments
def boundary_distance(a: Mask, b: Mask) -> float:
    """Mean distance in cells from the outline of each mask to that of the other, averaged over both.

    Example:
        >>> a, b = np.zeros((9, 9), bool), np.zeros((9, 9), bool)
        >>> a[2:5, 2:5], b[2:5, 3:6] = True, True
        >>> boundary_distance(a, a), 0.3 < boundary_distance(a, b) < 1.0
        (0.0, True)
    """
    check_alike("boundary_distance", a=a, b=b)
    if a.ndim != 2 or not a.any() or not b.any():
        raise ConfigError(f"boundary_distance: each mask is 2-d with a cell at least, got {a.shape}")
    part = window(a | b, 1)
    edges = [m & ~ndimage.binary_erosion(m) for m in (a[part], b[part])]
    away = [ndimage.distance_transform_edt(~edge) for edge in edges]
    there, back = float(np.mean(away[1][edges[0]])), float(np.mean(away[0][edges[1]]))
    return (there + back) / 2


def _score_frontiers(snapshot: Snapshot, judged: Decision, predictor: str) -> list[FrontierScore]:
    decision = snapshot.decision
    true = true_classes(decision, snapshot.truth)
    return [
        FrontierScore(
            **_origin(snapshot, predictor),
            x=float(frontier.centroid[0]),
            y=float(frontier.centroid[1]),
            closed=bool(frontier.is_closed),
            true_closed=bool(true.is_closed[k]),
            area=float(frontier.expected_area or 0.0),
            true_area=float(true.remaining_area[k]),
            confidence=float(frontier.confidence or 0.0),
        )
        for k, frontier in enumerate(judged.frontiers)
    ]
