"""What is noted beside a run, as arrays of its file: its replay, and what a layout changed in it.

A replay shows the map as it grew, frontiers, and rooms believed.

The map at any time is kept as one number a cell, the scan after which the cell was first known, and its
value then; the few cells that change later (noise, drift) are listed. Frontiers are kept as clusters of
cells, each once however many decisions it lasted. The run goes on as if nobody had noted anything.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.benchmark.counterfactual import Counterfactual, DecisiveDecision
from layoutexplore.errors import ResultsError, checks_calls
from layoutexplore.files.archives import ArrayRule, check_arrays
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.grids.arrays import Cells, Floats32, Ints, Ints32, Mask, shows_shapes, stored_places
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.options import NATURAL
from layoutexplore.simulation.simulation import Simulation

ROOMS_AT = (0.25, 0.5, 0.75)
"""Coverages at which the rooms believed are kept: predicting them for a picture takes time."""

_PREFIX = "replay_"
_NARROWED = ("first", "frontiers", "clusters", "decided", "shown", "flips", "rooms_at")
"""Arrays int32 that are stored in 16 bits where they fit."""


@checks_calls
@shows_shapes
@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """A run, to be shown again.

    Attributes:
        first: int32 (rows, cols), the number of the scan (1 is the first) after which a cell was first known;
            0 never.
        occupied: bool (rows, cols), whether it was occupied then, and not free.
        flips: int32 (k, 2), later changes between free and occupied: number of the scan, number of the cell.
        poses: float (n, 3), where the robot believed to be at each scan: x, y in metres, theta in radians;
            as `stored_places` has them.
        decided: int32 (d, 2), of each decision: number of scans before it, index of the frontier that was
            gone to among those of the decision (-1: none).
        shown: int32 (d + 1,), where the frontiers of each decision begin in `frontiers`.
        frontiers: int32 (m, 2), of each frontier of each decision: number of its cluster in `clusters`; 1
            when predicted to be closed, -1 when open, 0 without a prediction.
        areas: float32 (m,), predicted square metres behind it, to the centimetre squared.
        members: int32 (c,), the cells of all clusters, as row * cols + col.
        clusters: int32 (l + 1,), where each cluster begins in `members`.
        rooms_at: int32 (r,), numbers of the decisions at which the rooms believed were kept.
        rooms: int16 (r, rows, cols), int32 where they do not fit: their ids, 0 for none.
    """

    first: Ints32
    occupied: Mask
    flips: Ints32
    poses: NDArray[np.floating[Any]]
    decided: Ints32
    shown: Ints32
    frontiers: Ints32
    areas: Floats32
    members: Ints32
    clusters: Ints32
    rooms_at: Ints32
    rooms: NDArray[np.integer]

    def cells(self, scans: int) -> Cells:
        """The robot's grid after so many scans, int8 (rows, cols)."""
        NATURAL.convert("scans", scans)
        known = (self.first > 0) & (self.first <= scans)
        flips = np.bincount(self.flips[self.flips[:, 0] <= scans, 1], minlength=self.first.size)
        is_wall = self.occupied ^ (flips.reshape(self.first.shape) % 2 == 1)
        return np.where(known, np.where(is_wall, OCCUPIED, FREE), UNKNOWN).astype(np.int8)


def recording_to_arrays(recording: Recording) -> dict[str, NDArray[Any]]:
    """As named arrays, for a file: small types, booleans as bits."""
    arrays = {_PREFIX + name: getattr(recording, name) for name in Recording.__dataclass_fields__}
    arrays[f"{_PREFIX}occupied"] = np.packbits(recording.occupied)
    for name in _NARROWED:
        arrays[_PREFIX + name] = _narrow(arrays[_PREFIX + name])
    arrays[f"{_PREFIX}members"] = _narrow(np.diff(recording.members, prepend=np.int32(0)))
    return arrays


_RULES = {
    "first": ArrayRule(kinds="i", shape=("rows", "cols"), low=0),
    "occupied": ArrayRule(kinds="u", shape=("bytes",)),
    "flips": ArrayRule(kinds="i", shape=("flips", 2), low=0),
    "poses": ArrayRule(shape=("scans", 3), low=-1e9, high=1e9),
    "decided": ArrayRule(kinds="i", shape=("decisions", 2), low=-1),
    "shown": ArrayRule(kinds="i", shape=("offsets",), low=0),
    "frontiers": ArrayRule(kinds="i", shape=("frontiers", 2), low=-1),
    "areas": ArrayRule(shape=("frontiers",), finite=False),
    "members": ArrayRule(kinds="i", shape=("members",)),
    "clusters": ArrayRule(kinds="i", shape=("clusters",), low=0),
    "rooms_at": ArrayRule(kinds="i", shape=("pictures",), low=0),
    "rooms": ArrayRule(kinds="i", shape=("pictures", "rows", "cols"), low=0),
}
"""What must be kept of a run."""


def recording_from_arrays(arrays: Mapping[str, NDArray[Any]], where: str = "the run") -> Recording:
    """The inverse of `recording_to_arrays`; other arrays are ignored.

    Args:
        arrays: By name.
        where: Their file, for messages.

    Raises:
        KeyError: An array is missing.
        ResultsError: An array is none that `recording_to_arrays` makes, or contradicts another.
    """
    found = {name: arrays[_PREFIX + name] for name in Recording.__dataclass_fields__}
    check_arrays(found, _RULES, f"{where}: replay", ResultsError)
    shape = found["first"].shape
    if shape[0] * shape[1] > (most := limits().image_pixels):
        raise ResultsError(
            f"{where}: a map of {shape[0]} x {shape[1]} cells, and the limit image_pixels is {most:g}: "
            f"{raise_it('image_pixels', shape[0] * shape[1])}"
        )
    if len(found["occupied"]) != -(-shape[0] * shape[1] // 8):
        raise ResultsError(f"{where} is damaged: the replay's occupied cells do not fit its map")
    bits = np.unpackbits(found["occupied"], count=shape[0] * shape[1])
    found["occupied"] = bits.reshape(shape).astype(np.bool_)
    members = np.cumsum(found["members"], dtype=np.int64)
    _check_places(found, members, where)
    for name in _NARROWED:
        found[name] = found[name].astype(np.int32)
    found["members"] = members.astype(np.int32)
    return Recording(**found)


def _check_places(found: Mapping[str, NDArray[Any]], members: Ints, where: str) -> None:
    """Raise `ResultsError` where a number leads to what is not there."""
    cells, frontiers, decided = found["first"].size, found["frontiers"], found["decided"]
    shown, clusters = found["shown"], found["clusters"]
    good = [
        not len(members) or (members.min() >= 0 and members.max() < cells),
        not len(found["flips"]) or found["flips"][:, 1].max() < cells,
        len(shown) == len(decided) + 1 and shown[0] == 0 and shown[-1] == len(frontiers),
        len(clusters) > 0 and clusters[0] == 0 and clusters[-1] == len(members),
        all(np.all(np.diff(offsets.astype(np.int64)) >= 0) for offsets in (shown, clusters)),
        not len(frontiers) or (frontiers[:, 0].min() >= 0 and frontiers[:, 0].max() < len(clusters) - 1),
        not len(found["rooms_at"]) or found["rooms_at"].max() < len(decided),
    ]
    if not all(good):
        raise ResultsError(f"{where} is damaged: its replay contradicts itself")


RECORDED = tuple(_PREFIX + name for name in Recording.__dataclass_fields__)
"""Names of the arrays of a recording in a file."""


def _narrow(numbers: Ints32) -> NDArray[np.integer]:
    """The same numbers in 16 bits where they fit."""
    fits = not numbers.size or (numbers.min() >= -(1 << 15) and numbers.max() < 1 << 15)
    return numbers.astype(np.int16) if fits else numbers


class Recorder:
    """Notes a run: give `note_scan` to the simulation's `on_scan`, and `note_decision` to `play`.

    Args:
        with_rooms: Keep the rooms believed at `ROOMS_AT`, too.

    Attributes:
        seconds: Time that noting took.
    """

    def __init__(self, *, with_rooms: bool = True) -> None:
        self.seconds = 0.0
        self._with_rooms = with_rooms
        self._map: _GrowingMap | None = None
        self._poses: list[tuple[float, float, float]] = []
        self._decided: list[list[int]] = []
        self._shown = [0]
        self._frontiers: list[tuple[int, int]] = []
        self._areas: list[float] = []
        self._number: dict[bytes, int] = {}
        self._clusters: list[Ints] = []
        self._centres: list[tuple[float, float]] = []
        self._rooms: list[tuple[int, Ints32]] = []

    def note_scan(self, simulation: Simulation) -> None:
        """A scan was made."""
        began = time.perf_counter()
        cells = simulation.mapper.grid.cells
        if self._map is None:
            self._map = _GrowingMap(cells.shape)
        self._map.note(cells, simulation.state.changed, simulation.scans)
        believed = simulation.robot.believed
        self._poses.append((believed.x, believed.y, believed.theta))
        self.seconds += time.perf_counter() - began

    def note_decision(self, simulation: Simulation) -> None:
        """A decision is due, or the run is over."""
        began = time.perf_counter()
        self._note_choice(simulation)
        if not simulation.done:
            self._note_frontiers(simulation)
            due = ROOMS_AT[len(self._rooms)] if len(self._rooms) < len(ROOMS_AT) else 2.0
            rooms = simulation.decision.rooms
            if self._with_rooms and rooms is not None and simulation.coverage >= due:
                self._rooms.append((len(self._decided) - 1, np.array(rooms.labels, np.int32)))
        self.seconds += time.perf_counter() - began

    def _note_choice(self, simulation: Simulation) -> None:
        """Which frontier of the decision before was gone to."""
        goal = simulation.state.goal
        if self._decided and goal in self._centres:
            self._decided[-1][1] = self._centres.index(goal)

    def _note_frontiers(self, simulation: Simulation) -> None:
        decision = simulation.decision
        table, clusters = decision.table, decision.clusters
        cells = clusters.cells.astype(np.int64) @ np.array([decision.grid.cells.shape[1], 1])
        for k, (closed, area) in enumerate(zip(table.closed, table.expected_area, strict=True)):
            mine = cells[clusters.offsets[k] : clusters.offsets[k + 1]]
            number = self._number.setdefault(mine.tobytes(), len(self._clusters))
            if number == len(self._clusters):
                self._clusters.append(mine)
            self._frontiers.append((number, int(closed)))
            self._areas.append(round(float(area), 2))
        self._centres = list(zip(table.x.tolist(), table.y.tolist(), strict=True))
        self._decided.append([simulation.scans, -1])
        self._shown.append(len(self._frontiers))

    def end(self) -> Recording:
        """Everything noted, once the run is over."""
        grown = self._map or _GrowingMap((0, 0))
        offsets = np.cumsum([0, *map(len, self._clusters)])
        rooms = np.array([labels for _, labels in self._rooms], np.int32)
        return Recording(
            first=grown.first,
            occupied=grown.begun == OCCUPIED,
            flips=np.concatenate([np.empty((0, 2), np.int32), *grown.flips]),
            poses=np.round(stored_places(np.array(self._poses, np.float64).reshape(-1, 3)), 3),
            decided=np.array(self._decided, np.int32).reshape(-1, 2),
            shown=np.array(self._shown, np.int32),
            frontiers=np.array(self._frontiers, np.int32).reshape(-1, 2),
            areas=np.array(self._areas, np.float32),
            members=np.concatenate([np.empty(0, np.int32), *self._clusters]).astype(np.int32),
            clusters=offsets.astype(np.int32),
            rooms_at=np.array([k for k, _ in self._rooms], np.int32),
            rooms=_narrow(rooms.reshape(-1, *grown.first.shape)),
        )


class _GrowingMap:
    """When each cell of a grid became known, and what it was then."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.first: Ints32 = np.zeros(shape, np.int32)
        self.begun: Cells = np.full(shape, UNKNOWN, np.int8)
        self.flips: list[Ints32] = []
        self._now: Cells = np.full(shape, UNKNOWN, np.int8)
        self._flipped: Ints32 = np.empty(self.first.size, np.int32)

    def note(self, cells: Cells, box: Box, scan: int) -> None:
        """The grid after a scan, which may have changed in a box (half open)."""
        count = note_changes(cells, self._now, (self.first, self.begun), box, scan, self._flipped)
        if count:
            self.flips.append(np.stack([np.full(count, scan, np.int32), self._flipped[:count]], axis=1))


@njit(cache=True, nogil=True)
def note_changes(
    cells: Cells, before: Cells, grown: tuple[Ints32, Cells], box: Box, scan: int, flipped: Ints32
) -> int:
    """Note the cells of a box that changed since the last call.

    Args:
        cells: int8 (rows, cols), the grid now.
        before: int8 (rows, cols), the grid as it was; brought up to date.
        grown: int32 and int8 (rows, cols), the scan after which each cell was first known, and its value
            then; written where a cell becomes known.
        box: (row0, row1, col0, col1), half open.
        scan: Number of the scan, from 1.
        flipped: int32 (rows * cols,), begins with the numbers of the cells that had been known and changed.

    Returns:
        How many had been.
    """
    first, begun = grown
    count = 0
    for row in range(box[0], box[1]):
        for col in range(box[2], box[3]):
            value = cells[row, col]
            if value == before[row, col]:
                continue
            # A known cell never becomes unknown again: what is not new is a change between free and occupied.
            if first[row, col] == 0:
                first[row, col] = scan
                begun[row, col] = value
            else:
                flipped[count] = row * cells.shape[1] + col
                count += 1
            before[row, col] = value
    return count


def to_arrays(counterfactual: Counterfactual) -> dict[str, NDArray[np.generic]]:
    """As named arrays, for a file."""
    arrays: dict[str, NDArray[np.generic]] = {"log": counterfactual.log}
    for k, decided in enumerate(counterfactual.decisive):
        numbers = [
            decided.distance,
            decided.coverage,
            decided.stake,
            decided.without,
            decided.seen_after,
            decided.came_back,
        ]
        places = [decided.corner, decided.here, decided.chosen, decided.given_up]
        arrays[f"moment{k}_numbers"] = np.array(numbers, np.float64)
        arrays[f"moment{k}_places"] = np.array(places, np.int32)
        for name in ("cells", "judged", "members", "offsets"):
            arrays[f"moment{k}_{name}"] = getattr(decided, name)
    return arrays


_DECISIVE = {
    "numbers": ArrayRule(shape=(6,), finite=False),
    "places": ArrayRule(kinds="iu", shape=(4, 2), low=0, high=1e6),
    "cells": ArrayRule(kinds="i", shape=("rows", "cols"), low=-1, high=100),
    "judged": ArrayRule(shape=("frontiers", 4), low=0, high=1e12),
    "members": ArrayRule(kinds="i", shape=("members", 2), low=0, high=1e6),
    "offsets": ArrayRule(kinds="i", shape=("offsets",), low=0),
}
"""What must be kept of a decisive decision."""


def from_arrays(arrays: Mapping[str, NDArray[Any]], where: str = "the run") -> Counterfactual:
    """The inverse of `to_arrays`; other arrays are ignored.

    Args:
        arrays: By name.
        where: Their file, for messages.

    Raises:
        ResultsError: An array is missing, or is none that `to_arrays` makes.
    """
    decisive: list[DecisiveDecision] = []
    while f"moment{len(decisive)}_numbers" in arrays:
        begin = f"moment{len(decisive)}_"
        parts = {name: arrays.get(begin + name, np.zeros(0)) for name in _DECISIVE}
        check_arrays(parts, _DECISIVE, f"{where}: decisive decision {len(decisive)}", ResultsError)
        decisive.append(_decisive(parts, where))
    return Counterfactual(arrays["log"], tuple(decisive))


def _decisive(parts: Mapping[str, NDArray[Any]], where: str) -> DecisiveDecision:
    distance, coverage, stake, without, seen_after, came_back = parts["numbers"].tolist()
    corner, here, chosen, given_up = ((row, col) for row, col in parts["places"].tolist())
    judged, members, offsets = parts["judged"], parts["members"], parts["offsets"]
    good = np.isfinite([distance, coverage, stake]).all() and without in range(len(judged))
    good = good and len(offsets) == len(judged) + 1 and offsets[0] == 0 and offsets[-1] == len(members)
    if not good or np.diff(offsets).min() < 0:
        raise ResultsError(f"{where} is damaged: a decisive decision contradicts itself")
    return DecisiveDecision(
        distance=distance,
        coverage=coverage,
        stake=stake,
        corner=corner,
        here=here,
        chosen=chosen,
        given_up=given_up,
        without=int(without),
        seen_after=seen_after,
        came_back=bool(came_back),
        **{name: parts[name] for name in ("cells", "judged", "members", "offsets")},
    )
