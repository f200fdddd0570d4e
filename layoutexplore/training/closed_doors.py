"""Training of the trees that tell closed doors from walls and score the rectangles behind them.

Maps whose shut rooms are known are learnt from: those of a folder (NAME_k_doors_IN.png with NAME_GT.png), the
same buildings with other doors shut at random, and floor plans with doors shut at random. Every map's samples
are kept in a folder, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from layoutexplore.closed_doors.candidates import rectangles
from layoutexplore.closed_doors.doors import DOOR_FEATURES, ClosedDoor
from layoutexplore.closed_doors.features import FEATURES, describe
from layoutexplore.closed_doors.models import AGREEMENT, DOOR, DOOR_MODEL, ROOM_MODEL, Models
from layoutexplore.closed_doors.prediction import find_closed_doors, turned_scenes
from layoutexplore.closed_doors.scene import Scene, integral
from layoutexplore.errors import LayoutExploreError, ResultsError
from layoutexplore.files import ArrayRule, all_or_none, read_arrays, safe_name, write_arrays
from layoutexplore.files.reading import is_file, package_fingerprint
from layoutexplore.grids.arrays import Cells, Floats, Floats32, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, in_cells
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.formats.building_files import split_level
from layoutexplore.models.forest_files import save_forests
from layoutexplore.training.boosting import BoostingConfig, fit_forest
from layoutexplore.training.closed_door_examples import RESOLUTION, add_outer_doors, plan_cells, shut_rooms

SHUT_AGAIN, PLAN_MAPS = 5, 3
"""Simulated maps of each building of a folder, and of each floor plan."""

_EVERY = 2
"""Of the maps of a building, which share most of their doors, every second one is learnt from."""

DOOR_BOOSTING = BoostingConfig(trees=80, rate=0.08, leaves=8, leaf_samples=15, feature_share=0.4)
ROOM_BOOSTING = BoostingConfig(trees=150, rate=0.08, leaves=12, leaf_samples=40, feature_share=0.3)
"""How the trees that find doors and those that score rectangles are grown."""

_KEPT, _BEST = 24, 4
"""Rectangles kept of a door: at random, and the best."""

_BEHIND = 0.35
"""Metres behind an edge that are hidden where it is a door."""

_TOUCHED = 0.075
"""Square metres of a hidden room that must lie right behind a door of it."""


@dataclass(frozen=True, eq=False)
class ClosedDoorSamples:
    """Edges and rectangles of one map or several.

    Attributes:
        edges: float32 (n, door features).
        is_door: bool (n,), a shut room lies behind.
        boxes: float32 (m, features).
        agreement: float32 (m,), intersection over union with the shut room behind the door.
        weight: float32 (m,), less for each where a door has many.
    """

    edges: Floats32
    is_door: Mask
    boxes: Floats32
    agreement: Floats32
    weight: Floats32


def collect(cells: Cells, truth: Cells, resolution: float, rng: np.random.Generator) -> ClosedDoorSamples:
    """The edges of a map and the rectangles behind its doors, with what is true of them.

    Args:
        cells: int8 (rows, cols), what is seen.
        truth: int8 (rows, cols), the same frame.
        resolution: Metres a cell.
        rng: Which rectangles are kept.
    """
    hidden = (truth == FREE) & (cells != FREE)
    _, rooms = cv2.connectedComponents(hidden.astype(np.uint8), connectivity=4)
    edges: list[Floats32] = []
    labels: list[Mask] = []
    deep = round(_BEHIND / resolution) - 1

    def classifier(turns: int, found: Ints, features: Floats32) -> Floats:
        behind = np.rot90(hidden, turns)
        is_door = np.array(
            [behind[max(row - deep, 0) : row + 1, a:b].mean() > 0.5 for row, a, b in found], np.bool_
        )
        edges.append(features)
        labels.append(is_door)
        return is_door.astype(np.float64)

    doors = find_closed_doors(cells, resolution, classifier)
    features, agreement, weight = [np.empty((0, len(FEATURES)))], [np.empty(0)], [np.empty(0)]
    for turns, scene in enumerate(turned_scenes(cells, resolution, doors)):
        behind = np.rot90(hidden, turns), np.rot90(rooms, turns)
        for door in doors[turns]:
            boxes = rectangles(scene, door)
            if not len(boxes):
                continue
            agreed = agreement_of(scene, door, boxes, *behind)
            kept = np.union1d(rng.permutation(len(boxes))[:_KEPT], np.argsort(-agreed, kind="stable")[:_BEST])
            features.append(describe(scene, door, boxes[kept]))
            agreement.append(agreed[kept])
            weight.append(np.full(len(kept), len(kept) ** -0.5))
    boxes_, agreed_, weight_ = (
        np.concatenate(part).astype(np.float32) for part in (features, agreement, weight)
    )
    return ClosedDoorSamples(np.concatenate(edges), np.concatenate(labels), boxes_, agreed_, weight_)


def agreement_of(scene: Scene, door: ClosedDoor, boxes: Ints, hidden: Mask, rooms: Ints32) -> Floats:
    """Intersection over union float64 (n,) of each rectangle and the hidden room behind the door."""
    deep = in_cells(0.3, scene.resolution)
    behind = rooms[max(door.row - deep, 0) : door.row + 1, door.start : door.stop]
    ids, counts = np.unique(behind[behind > 0], return_counts=True)
    room = np.isin(rooms, ids[counts > round(_TOUCHED / scene.resolution**2)])
    if not room.any():
        return np.zeros(len(boxes))
    top, left, bottom, right = boxes.T

    def inside(mask: Mask) -> Ints:
        s = integral(mask)
        return np.asarray(s[bottom, right] - s[top, right] - s[bottom, left] + s[top, left], np.int64)

    size = scene.count("possible", boxes)
    return np.asarray(inside(hidden & scene.possible) / np.maximum(size + room.sum() - inside(room), 1))


def fit(samples: Iterable[ClosedDoorSamples], *, trees: int = 150) -> Models:
    """Train both forests on the samples of several maps; `trees` is the number of trees for rectangles."""
    parts = list(samples)
    edges, is_door, boxes, agreement, weight = (
        np.concatenate([getattr(part, name) for part in parts]) for name in _SAMPLES
    )
    rooms = replace(ROOM_BOOSTING, trees=trees)
    return Models(fit_forest(edges, is_door, DOOR_BOOSTING), fit_forest(boxes, agreement, rooms, weight))


@dataclass(frozen=True)
class Source(ABC):
    """A map to learn from.

    Attributes:
        building: It is held out together with the others of its building.
        name: Of it, and what its chance follows from; plans whose files have one name share it.
    """

    building: str
    name: str

    @property
    @abstractmethod
    def files(self) -> Sequence[Path]:
        """What it is made from."""

    @abstractmethod
    def maps(self, rng: np.random.Generator) -> tuple[Cells, Cells] | None:
        """What is seen, and the truth; None where no room can be shut."""


@dataclass(frozen=True)
class RecordedMap(Source):
    """A map of a folder, with its truth."""

    seen: Path
    truth: Path

    @property
    def files(self) -> Sequence[Path]:
        """What is seen, and the truth."""
        return [self.seen, self.truth]

    def maps(self, rng: np.random.Generator) -> tuple[Cells, Cells]:
        """Both as they are recorded."""
        from layoutexplore.maps.closed_door_maps import read_cells

        return read_cells(self.seen), read_cells(self.truth)


@dataclass(frozen=True)
class ShutMap(Source):
    """The truth of a map of a folder, with doors shut at random."""

    truth: Path

    @property
    def files(self) -> Sequence[Path]:
        """The truth."""
        return [self.truth]

    def maps(self, rng: np.random.Generator) -> tuple[Cells, Cells] | None:
        """Other doors than the recorded ones are shut."""
        from layoutexplore.maps.closed_door_maps import read_cells

        return _with_doors_shut(read_cells(self.truth), rng)


@dataclass(frozen=True)
class ShutPlan(Source):
    """A floor plan with doors shut at random.

    Attributes:
        plan: As `load_plan` takes it.
    """

    plan: str

    @property
    def files(self) -> Sequence[Path]:
        """Of the plan; none of one that is generated."""
        from layoutexplore.maps.library import source_files

        return source_files(self.plan)

    def maps(self, rng: np.random.Generator) -> tuple[Cells, Cells] | None:
        """Some doors of the plan are shut."""
        from layoutexplore.maps import load_plan

        return _with_doors_shut(plan_cells(load_plan(self.plan), RESOLUTION, rng), rng)


def _with_doors_shut(truth: Cells, rng: np.random.Generator) -> tuple[Cells, Cells] | None:
    cells = shut_rooms(truth, RESOLUTION, rng)
    return None if cells is None else add_outer_doors(cells, truth, RESOLUTION, rng, int(rng.integers(3)))


def find_sources(folder: Path | None, plans: Sequence[str]) -> list[Source]:
    """The maps that can be learnt from.

    Args:
        folder: NAME_k_doors_IN.png with NAME_GT.png, or None.
        plans: Floor plans to shut doors in.
    """
    from layoutexplore.maps.closed_door_maps import find_triples

    triples = find_triples(folder) if folder else []
    out: list[Source] = [
        RecordedMap(building_of(t.building, "closed doors"), t.name, t.seen, t.truth)
        for t in triples
        if t.doors % _EVERY == 0
    ]
    for name, truth in {t.building: t.truth for t in triples}.items():
        building = building_of(name, "closed doors")
        out += [ShutMap(building, f"{name}-shut-{k}", truth) for k in range(SHUT_AGAIN)]
    named = [(_name_of(plan), plan) for plan in plans]
    for k in range(PLAN_MAPS):
        out += [ShutPlan(building_of(name, "closed doors"), f"{name}-plan-{k}", plan) for name, plan in named]
    return out


def _name_of(plan: str) -> str:
    """The name of a plan, with its floor where a file has several; with no spaces, as its maps are named."""
    path, level = split_level(plan)
    name = path.name.split(".")[0] + (f"-{level}" if level else "")
    return name.replace(" ", "_")


_SAMPLES = {
    "edges": ArrayRule(shape=("edges", len(DOOR_FEATURES)), finite=False),
    "is_door": ArrayRule(kinds="biuf", shape=("edges",), low=0, high=1),
    "boxes": ArrayRule(shape=("boxes", len(FEATURES)), finite=False),
    "agreement": ArrayRule(shape=("boxes",), low=0, high=1),
    "weight": ArrayRule(shape=("boxes",), low=0, high=1),
}
"""What is kept of a map: all of `ClosedDoorSamples`."""


def samples_of(source: Source, cache: Path | None = None) -> ClosedDoorSamples | None:
    """The samples of a map, kept in a folder where one is given; None where no room can be shut."""
    kept = cache / f"{safe_name(source.name)}-{_digest_of(source)}.npz" if cache else None
    if kept is not None and kept.exists():
        try:
            return ClosedDoorSamples(**read_arrays(kept, *_SAMPLES, rules=_SAMPLES))
        except ResultsError as error:
            warnings.warn(f"{error}; it is made anew", stacklevel=2)
    rng = np.random.default_rng([*source.name.encode()])
    maps = source.maps(rng)
    if maps is None:
        return None
    samples = collect(*maps, RESOLUTION, rng)
    if kept is not None:
        write_arrays(kept, {name: getattr(samples, name) for name in _SAMPLES})
    return samples


def _digest_of(source: Source) -> str:
    """Tells samples of one name apart: of the files of a map, or of a plan's name, and of the code."""
    plan = source.plan if isinstance(source, ShutPlan) else ""
    digest = hashlib.sha256(package_fingerprint().encode())
    digest.update(b"" if source.files else plan.encode())
    digest.update(split_level(plan)[1].encode())
    for path in filter(is_file, source.files):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:8]


def collect_all(
    sources: Sequence[Source],
    cache: Path | None = None,
    progress: Callable[[int, int, str], None] = lambda done, total, name: None,
) -> Iterator[tuple[Source, ClosedDoorSamples]]:
    """The samples of all maps, those left out where no room can be shut or a plan cannot be used."""
    for k, source in enumerate(sources):
        samples = None
        try:
            samples = samples_of(source, cache)
        except LayoutExploreError as error:
            print(f"left out: {error}", flush=True)
        progress(k + 1, len(sources), source.name)
        if samples is not None:
            yield source, samples


def save(models: Models, folder: Path, note: str) -> None:
    """Write both forests, or none."""
    with all_or_none(folder) as beside:
        save_forests(beside / DOOR_MODEL.name, {DOOR: models.doors}, DOOR_FEATURES, note)
        save_forests(beside / ROOM_MODEL.name, {AGREEMENT: models.rooms}, FEATURES, note)
