"""A plan known beforehand: registered with the map at every decision, it foresees rooms nobody has seen.

While the registration is not sure, and where the plan is silent or contradicted, the shipped predictor speaks
for classes, areas and rooms; what the robot has seen always wins.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from functools import cached_property, partial
from typing import Any

import numpy as np

from layoutexplore.errors import ConfigError, checks_calls, checks_making, shortened, unknown_name
from layoutexplore.frontiers.classes import classify_frontiers
from layoutexplore.frontiers.decision import Decision, Truth
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.metrics.overlaps import most_shared
from layoutexplore.options import SHARE, check_kind, split_pairs
from layoutexplore.predictors.learned import LearnedPredictor
from layoutexplore.predictors.protocol import RoomLabels, RoomsOnGrid, with_classes
from layoutexplore.priors.completion import PlanOnMap
from layoutexplore.priors.confidence import confidence
from layoutexplore.priors.plan import PriorHints, PriorPlan
from layoutexplore.priors.presets import PRESETS, made_from, study_prior
from layoutexplore.priors.reading import read_prior
from layoutexplore.priors.registration import Registration

SURE = 0.5
"""Confidence from which a plan is believed: what it foresees is handed on, and planners rely on that."""

DOUBTED = 0.5
"""Share of that confidence below which a plan that was believed is believed no longer."""

TRUE_PRESETS = ("true", "rough", "corridors", "mirrored")
"""Presets that show the floor of the run, well or badly."""

HINTS = ("scale", "rotation", "mirror", "here")
"""Options that tell something of a plan's place."""


@checks_calls
class PriorPredictor:
    """Rooms, classes and foresight by a plan known beforehand.

    It follows one run: explorations side by side need one each.

    Args:
        source: A plan that has been read; or a floor plan or picture by name; or a preset of
            `layoutexplore.priors.presets`, which is made from the plan of each run with the run's seed.
        hints: What is told of a plan that is read.
        among: Where presets find other floors and buildings.
        sure: Confidence from which the plan is believed, 0..1.

    Attributes:
        registration: Of the run.
        confidence: At the last decision.

    Raises:
        MapError: The file cannot be read, or is no plan.
        ConfigError: Hints of a preset or of a plan that has been read.
    """

    remembers = True
    """What it believes comes from all decisions of a run: one that goes on asks it at each of them again."""

    def __init__(
        self, source: PriorPlan | str, hints: PriorHints | None = None, *, among: str = "", sure: float = SURE
    ) -> None:
        self._among, self._sure, self._shipped = among, sure, LearnedPredictor()
        check_kind("source", source, PriorPlan, str)
        check_kind("hints", hints, PriorHints, optional=True)
        if hints not in (None, PriorHints()) and (isinstance(source, PriorPlan) or source in PRESETS):
            raise ConfigError(
                "hints are told of a floor plan or picture that is read: a preset takes none, and a "
                "PriorPlan has its own (prior_of_plan(plan, hints))"
            )
        check_kind("among", among, str)
        SHARE.convert("sure", sure)
        self._prior: PriorPlan | None = None
        if isinstance(source, PriorPlan):
            self._source, self._prior = source.name, source
        else:
            self._source = source
            self._prior = None if source in PRESETS else read_prior(source, hints)
        self.name = f"prior:{self._source}"
        self._begin(self._prior)

    @property
    def fingerprint(self) -> str:
        """Of the models of the shipped predictor, and of the plan or what it is made or chosen from."""
        if self._prior is not None:
            plan = fingerprint_of(self._prior)
        else:
            plan = made_from(self._source, self._among)
        return f"{self._shipped.fingerprint}{plan}"

    def reveal(self, truth: Truth) -> None:
        """A run begins: presets are made from its plan; of a plan that was given nothing is revealed."""
        prior = self._prior
        if prior is None:
            prior = study_prior(self._source, truth.plan, truth.seed, among=self._among).prior
        self._begin(prior)

    def _begin(self, prior: PriorPlan | None) -> None:
        self.registration = None if prior is None else Registration(prior)
        self.confidence, self._believed, self._on_map = 0.0, False, PlanOnMap()
        self._asked: tuple[OccupancyGrid, int, int] | None = None
        self._foreseen: Foresight | None = None

    @property
    def shows_truth(self) -> bool:
        """Whether its plan is made from that of the run; a file, another floor or building is not."""
        return self._prior is None and self._source in TRUE_PRESETS

    @property
    def unused(self) -> str:
        """Why the plan is not used; empty where it may be."""
        return self.registration.prior.unused if self.registration else ""

    def predict(self, decision: Decision) -> Decision:
        """The decision with classes, areas and rooms, and with foresight where the plan is believed."""
        if not decision.frontiers:
            return decision
        shipped = self._shipped.predict(decision)
        foreseen = self._foresee(decision)
        if foreseen is None:
            return shipped
        return _completed(shipped, foreseen)

    def rooms(self, decision: Decision) -> RoomLabels:
        """The rooms of the shipped predictor, and foreseen ones where the plan is believed."""
        found = self._shipped.rooms(decision)
        foreseen = self._foresee(decision)
        return found if foreseen is None else _joined(found, foreseen, decision)

    def _foresee(self, decision: Decision) -> Foresight | None:
        """What is foreseen; None while the plan is not believed. The plan is registered once a decision."""
        asked = decision.grid, decision.step, len(decision.track)
        if self._asked is None or self._asked[0] is not asked[0] or self._asked[1:] != asked[1:]:
            self._asked, self._foreseen = asked, self._registered(decision)
        return self._foreseen

    def _registered(self, decision: Decision) -> Foresight | None:
        if self.registration is None or self.registration.prior.unused:
            return None  # no run has begun from whose plan one could be made, or it tells nothing
        if decision.step == 0 and len(decision.track):
            self.registration.start = float(decision.track[0, 0]), float(decision.track[0, 1])
        self.registration.update(decision.grid)
        self.confidence = confidence(self.registration)
        # Whoever believes at any confidence (sure=0) still needs a place to believe in.
        placed = bool(self.registration.hypotheses)
        self._believed = placed and self.confidence >= self._sure * (DOUBTED if self._believed else 1.0)
        if not self._believed:
            return None
        return self._on_map.foresee(self.registration, decision.grid, self.confidence, self.name)


def fingerprint_of(prior: PriorPlan) -> str:
    """A text that changes with what a plan shows."""
    digest = hashlib.sha256(np.packbits(prior.free).tobytes() + prior.room_ids.tobytes())
    return f"{digest.hexdigest()[:16]}@{prior.resolution:.6g}"


def _completed(shipped: Decision, foreseen: Foresight) -> Decision:
    """Classes and areas by the plan where it shows floor behind a frontier, else as they were."""
    assert shipped.rooms is not None
    cells, table = shipped.grid.cells, shipped.table
    passable = (cells == FREE) | foreseen.hidden(cells)
    ids = owners_of(shipped.rooms.sketch, foreseen, cells, alone=True)[foreseen.room_ids]
    classes = classify_frontiers(cells, shipped.clusters, ids, passable, foreseen.resolution)
    told = (classes.room > 0) & foreseen.beside(cells, shipped.clusters).is_told
    rooms = np.array([frontier.room or 0 for frontier in shipped.frontiers], np.int32)
    judged = dataclasses.replace(
        classes,
        is_closed=np.where(told, classes.is_closed, table.closed > 0),
        room=np.where(told, classes.room, rooms).astype(np.int32),
        remaining_area=np.where(told, classes.remaining_area, table.expected_area),
    )
    sure = np.where(told, foreseen.confidence, table.confidence)
    completed = with_classes(shipped, judged, ForeseenRooms(shipped, foreseen), sure)
    return dataclasses.replace(completed, foresee=partial(_itself, foreseen))


def _itself(foreseen: Foresight) -> Foresight:
    return foreseen


@checks_making
class ForeseenRooms(RoomsOnGrid):
    """Rooms of the shipped predictor and of the plan, joined when somebody looks at them.

    Args:
        shipped: The decision as the shipped predictor completed it.
        foreseen: What the plan says.
    """

    def __init__(self, shipped: Decision, foreseen: Foresight) -> None:
        super().__init__(foreseen.predictor, shipped.grid)
        self._shipped, self._foreseen = shipped, foreseen

    @cached_property
    def rooms(self) -> RoomLabels:
        """Seen rooms as the shipped predictor has them, unseen cells as the plan shows them."""
        return self._beside_foreseen("labels")

    @cached_property
    def sketch(self) -> Ints32:
        """The same beside a sketch of the shipped predictor: nothing is completed for it."""
        return self._beside_foreseen("sketch").room_ids

    def _beside_foreseen(self, name: str) -> RoomLabels:
        ids: Ints32 = getattr(self._shipped.rooms, name)
        cells = self._shipped.grid.cells
        return _joined(RoomLabels(ids, (cells == FREE) | (ids > 0)), self._foreseen, self._shipped)


def _joined(found: RoomLabels, foreseen: Foresight, decision: Decision) -> RoomLabels:
    """Rooms of a predictor, with unseen cells as they are foreseen.

    A foreseen room that is seen in part takes the id of the room that has most of what is seen of it.
    """
    cells = decision.grid.cells
    ids = found.room_ids
    if found.rest:
        ids = np.where(ids == found.rest, np.int32(0), ids)
    owner = owners_of(ids, foreseen, cells)
    unseen = cells == UNKNOWN
    shown = unseen & (foreseen.cells != UNKNOWN)
    joined = np.where(shown, owner[foreseen.room_ids], ids).astype(np.int32)
    passable = np.where(shown, foreseen.cells == FREE, found.passable)
    return RoomLabels(joined, np.asarray(passable, np.bool_))


def owners_of(ids: Ints32, foreseen: Foresight, cells: Cells, *, alone: bool = False) -> Ints32:
    """int32 (highest foreseen id + 1,): the room that each foreseen one is; a new id where it is none.

    Args:
        ids: int32 (rows, cols), rooms of seen cells.
        foreseen: What is foreseen.
        cells: int8 (rows, cols), what is known.
        alone: Whether a room is one foreseen room at most, the one of which most is seen; otherwise two
            foreseen rooms that are seen as one become one.
    """
    top, rooms = int(ids.max(initial=0)) + 1, int(foreseen.room_ids.max(initial=0)) + 1
    both = (cells == FREE) & (ids > 0) & (foreseen.room_ids > 0)
    best, seen = most_shared(foreseen.room_ids[both], ids[both], count=rooms)
    owned = seen > 0
    if alone:
        rising = np.lexsort((seen, best))
        owned[rising[:-1]] &= np.diff(best[rising]) > 0
    owner = np.where(owned, best, top + np.arange(rooms)).astype(np.int32)
    owner[0] = 0
    return owner


def predictor_of_prior(text: str) -> PriorPredictor:
    """The predictor of `FILE`, `PRESET` or either with `;key=value` behind it.

    Raises:
        UnknownNameError: No such option.
        ConfigError: A value makes no sense.
        MapError: The file cannot be read, or is no plan.

    Example:
        >>> predictor_of_prior("rough").name
        'prior:rough'
    """
    source, *items = (item.strip() for item in text.split(";"))
    if not source:
        raise ConfigError("prior: name a file, or one of " + ", ".join(PRESETS))
    where = f"predictor {shortened(f'prior:{text}')}"
    values: dict[str, Any] = dict(split_pairs(where, items))
    known = ("among", "sure", *HINTS)
    for key in values:
        if key not in known:
            raise unknown_name("option of predictor prior:", key, known)
    given: dict[str, Any] = {
        key: _number(where, key, values[key]) for key in ("scale", "rotation") if key in values
    }
    sure = _number(where, "sure", values["sure"]) if "sure" in values else SURE
    if not 0 <= sure <= 1:
        raise ConfigError(f"{where}: sure is a probability 0..1, got {sure:g}")
    if "mirror" in values:
        words = {"yes": True, "no": False}
        if values["mirror"] not in words:
            raise ConfigError(f"{where}: mirror is yes or no, got {shortened(values['mirror'])}")
        given["mirror"] = words[values["mirror"]]
    if "here" in values:
        parts = [_number(where, "here", part) for part in values["here"].split("/")]
        if len(parts) != 2:
            raise ConfigError(f"{where}: here is X/Y, a point of the plan, got {shortened(values['here'])}")
        given["here"] = (parts[0], parts[1])
    found = PriorPredictor(source, PriorHints(**given), among=values.get("among", ""), sure=sure)
    found.name = f"prior:{text}"
    return found


def _number(where: str, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(f"{where}: {key} must be a number, got {shortened(text)}")
    return value
