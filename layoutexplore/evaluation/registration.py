"""How well prior plans are registered: place, confidence and calibration while floors are explored."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import layoutexplore
from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError, ResultsError, checks_arguments
from layoutexplore.files import atomic, read_json, safe_name
from layoutexplore.files.reading import is_there
from layoutexplore.files.schema import Items, Number, Record, Text
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import cached_plan
from layoutexplore.metrics.statistics import Interval, cluster_bootstrap, weighted_mean
from layoutexplore.predictors.learned import LearnedPredictor
from layoutexplore.priors.confidence import FEATURES, features_of, shipped_model
from layoutexplore.priors.presets import StudyPrior, digest_of_others, made_from, study_prior
from layoutexplore.priors.registration import Registration
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

COVERAGES = (0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.75)
"""Shares of the floor seen at which registrations are judged."""

RIGHT = 1.0
"""Metres; a hypothesis is right where the median error of the doors not yet seen is at most this."""

EXPLORER = "layout-tour"
"""Who explores: its way does not depend on the plan, and is that of `plan-tour` until a plan is believed."""


@dataclass(frozen=True, kw_only=True)
class RegistrationRow:
    """A registration at a decision of an exploration.

    Attributes:
        plan: The floor.
        building: Its building.
        sensor: Of the robot.
        kind: The preset of the prior plan.
        coverage: The highest of `COVERAGES` that has been seen since the decision before; 0 without any.
        features: As of `layoutexplore.priors.confidence`; empty without a hypothesis.
        error: Median error in metres of the doors not yet seen; inf without a hypothesis or a right place.
        first_ms: Milliseconds of processor time of the first match.
        median_ms: Of the decisions after it, up to here, their median ...
        p95_ms: ... and their 95th percentile.
    """

    plan: str
    building: str
    sensor: str
    kind: str
    coverage: float
    features: tuple[float, ...]
    error: float
    first_ms: float
    median_ms: float
    p95_ms: float

    @property
    def right(self) -> bool:
        """Whether the best hypothesis is right."""
        return self.error <= RIGHT


@checks_arguments
def registration_rows(
    plan: FloorPlan,
    kinds: Sequence[str],
    *,
    sensor: str = "stage",
    seed: int = 0,
    among: str = "",
    store: Path | None = None,
) -> list[RegistrationRow]:
    """Registrations of several prior plans while one robot explores a floor.

    Args:
        plan: The floor.
        kinds: Presets.
        sensor: Of the robot.
        seed: Of the start, and of the prior plans.
        among: Where presets find other floors and buildings; a kind for which there is none is left out.
        store: Folder where rows are kept; those that are there already are read, unless another
            version made them, their features were others, the files of `among` have changed, or Tesseract,
            by which words on pictures are found, has come or gone.

    Raises:
        ResultsError: A file of rows is damaged.
    """
    made_by = f"{layoutexplore.__version__} {among} {digest_of_others(among)}{made_from('rough', among)}"
    key = hashlib.sha256(made_by.encode()).hexdigest()[:8]
    name = f"{safe_name(plan.name)}_{plan.raster_hash[:8]}_{sensor}_{seed}_{key}.json"
    path = store and store / name
    kept: dict[str, list[RegistrationRow]] = {}
    if path and is_there(path):
        known = _read(path)
        stale = {row.kind for row in known if len(row.features) not in (0, len(FEATURES))}
        for row in known:
            if row.kind not in stale:
                kept.setdefault(row.kind, []).append(row)
    waiting = [kind for kind in kinds if kind not in kept]
    priors = dict(_priors(plan, waiting, seed, among))
    if priors:
        kept |= _explore(plan, priors, sensor, seed)
        if path:
            _write(path, [row for rows in kept.values() for row in rows])
    return [row for kind in kinds for row in kept.get(kind, [])]


@checks_arguments
def rows_of_source(
    source: str, sensor: str, *, kinds: Sequence[str], among: str = "", store: Path | None = None
) -> list[RegistrationRow]:
    """The rows of a floor plan by its name or file, with one sensor."""
    return registration_rows(cached_plan(source), kinds, sensor=sensor, among=among, store=store)


def _priors(plan: FloorPlan, kinds: Sequence[str], seed: int, among: str) -> Iterator[tuple[str, StudyPrior]]:
    for kind in kinds:
        try:
            yield kind, study_prior(kind, plan, seed, among=among)
        except ConfigError:
            continue  # no other floor of this building is known


def _explore(
    plan: FloorPlan, priors: dict[str, StudyPrior], sensor: str, seed: int
) -> dict[str, list[RegistrationRow]]:
    """The rows of each prior plan."""
    simulation = Simulation(plan, SimulationConfig(sensor=sensor), LearnedPredictor())
    agent = make_agent(EXPLORER)
    decision = simulation.reset(seed=seed)
    agent.reset(seed)
    registrations = {kind: Registration(made.prior) for kind, made in priors.items()}
    took: dict[str, list[float]] = {kind: [] for kind in priors}
    rows: dict[str, list[RegistrationRow]] = {kind: [] for kind in priors}
    doors = _doors(plan)
    waiting = list(COVERAGES)
    while not simulation.done and waiting:
        seen = [share for share in waiting if simulation.coverage >= share]
        waiting = waiting[len(seen) :]
        unseen = _unseen(doors, decision.grid)
        for kind, registration in registrations.items():
            began = time.process_time()
            registration.update(decision.grid)
            took[kind].append(1000 * (time.process_time() - began))
            found = features_of(registration) if registration.hypotheses else np.zeros(0)
            row = RegistrationRow(
                plan=plan.name,
                building=plan.building,
                sensor=sensor,
                kind=kind,
                coverage=seen[-1] if seen else 0.0,
                features=tuple(found.tolist()),
                error=door_error(registration, priors[kind].place, unseen),
                **_times(took[kind]),
            )
            rows[kind].append(row)
        decision = simulation.step(agent.act(decision))
    return rows


def _times(took: Sequence[float]) -> dict[str, float]:
    """Milliseconds of the first match, which is the first decision to take more than one, and of the rest."""
    first = next((k for k, ms in enumerate(took) if ms > 1.0), 0)
    later = took[first + 1 :] or [0.0]
    median, p95 = np.percentile(later, [50, 95]).tolist()
    return {"first_ms": took[first], "median_ms": median, "p95_ms": p95}


def _doors(plan: FloorPlan) -> Floats:
    """Middles of the doors (of the rooms, where there are none), float64 (n, 2)."""
    if plan.doors:
        return np.array([np.mean([door.start, door.end], axis=0) for door in plan.doors])
    return np.array([room.polygon.representative_point().coords[0] for room in plan.rooms])


def _unseen(points: Floats, grid: OccupancyGrid) -> Floats:
    """Those of the points whose cell is not known; all where every one is."""
    cells = [grid.nearest_cell(x, y) for x, y in points.tolist()]
    unseen = np.array([grid.cells[cell] == UNKNOWN for cell in cells], np.bool_)
    return points[unseen] if unseen.any() else points


@checks_arguments
def door_error(registration: Registration, place: Callable[[Floats], Floats] | None, points: Floats) -> float:
    """Median error in metres of where the best hypothesis puts points; inf where nothing is right."""
    if place is None or not registration.hypotheses:
        return float("inf")
    found = registration.hypotheses[0].placed.to_world(place(points))
    return float(np.median(np.hypot(*(found - points).T)))


@checks_arguments
def moments_of(rows: Sequence[RegistrationRow]) -> list[tuple[str, str, str, float]]:
    """Exploration and share seen of each row, of explorations from their beginning on."""
    shares: dict[tuple[str, str, str], float] = {}
    found = []
    for row in rows:
        key = row.plan, row.sensor, row.kind
        shares[key] = max(row.coverage, shares.get(key, 0.0))
        found.append((*key, shares[key]))
    return found


@checks_arguments
def rows_until(rows: Sequence[RegistrationRow], share: float) -> list[RegistrationRow]:
    """Those until so much of the floor has been seen, of explorations from their beginning on."""
    done: set[tuple[str, str, str]] = set()
    found = []
    for row in rows:
        key = row.plan, row.sensor, row.kind
        if key not in done:
            found.append(row)
        if row.coverage >= share:
            done.add(key)
    return found


@checks_arguments
def confidences(rows: Sequence[RegistrationRow]) -> Floats:
    """The confidence of each row, float64 (n,); 0 without a hypothesis."""
    found = np.zeros(len(rows))
    some = [k for k, row in enumerate(rows) if row.features]
    if some:
        found[some] = shipped_model().probability(np.array([rows[k].features for k in some]))
    return found


@dataclass(frozen=True, kw_only=True)
class RegistrationScore:
    """One kind of plan at one share seen; intervals over buildings.

    Attributes:
        kind: The preset.
        coverage: Share seen.
        floors: How many explorations.
        right: Share of them whose best hypothesis is right.
        error: Median over explorations of the doors' error in metres; inf where most have no right place.
        confidence: Mean confidence.
        believed: Share that is believed.
        wrongly: Share that is believed and not right.
    """

    kind: str
    coverage: float
    floors: int
    right: Interval
    error: float
    confidence: float
    believed: float
    wrongly: float


@checks_arguments
def score_registrations(rows: Sequence[RegistrationRow], sure: float) -> list[RegistrationScore]:
    """One line a kind and coverage."""
    found = []
    confidence = confidences(rows)
    for kind in dict.fromkeys(row.kind for row in rows):
        for coverage in COVERAGES:
            chosen = [k for k, row in enumerate(rows) if (row.kind, row.coverage) == (kind, coverage)]
            if not chosen:
                continue
            right = np.array([rows[k].right for k in chosen], np.float64)
            believed = confidence[chosen] >= sure
            buildings = np.array([rows[k].building for k in chosen])
            found.append(
                RegistrationScore(
                    kind=kind,
                    coverage=coverage,
                    floors=len(chosen),
                    right=cluster_bootstrap(right, buildings, weighted_mean),
                    error=float(np.median([rows[k].error for k in chosen])),
                    confidence=float(confidence[chosen].mean()),
                    believed=float(believed.mean()),
                    wrongly=float((believed & (right == 0)).mean()),
                )
            )
    return found


_TEXTS = ("plan", "building", "sensor", "kind")
_NUMBERS = ("coverage", "error", "first_ms", "median_ms", "p95_ms")
_ROWS = Items(
    Record(dict.fromkeys(_TEXTS, Text()) | dict.fromkeys(_NUMBERS, Number()) | {"features": Items(Number())})
)


def _write(path: Path, rows: Sequence[RegistrationRow]) -> None:
    table = [{**asdict(row), "error": min(row.error, 1e9)} for row in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic(path) as temporary:
        temporary.write_text(json.dumps(table), encoding="utf-8")


def _read(path: Path) -> list[RegistrationRow]:
    try:
        data = read_json(path, _ROWS, error=ResultsError)
    except ResultsError as error:
        raise ResultsError(f"{error}; delete the file, and the floor is explored again") from error
    found = []
    for row in data:
        values: dict[str, Any] = {key: row[key] for key in (*_TEXTS, *_NUMBERS)}
        values["error"] = float("inf") if values["error"] >= 1e9 else values["error"]
        found.append(RegistrationRow(**values, features=tuple(row["features"])))
    return found
