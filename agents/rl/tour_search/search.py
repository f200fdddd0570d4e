"""Search for a tour's parameters by whole explorations (parameter-exploring policy search; Sehnke 2010).

A single decision changes an exploration's length by far less than what happens by chance behind it, so that
learning from single decisions needs very many. Here a draw of parameters is kept for a whole exploration,
where all its decisions add up, and a few draws, in mirrored pairs, explore the same floor plan from the same
start. After every round a response surface is fitted to all explorations so far, and the centre of the draws
moves to where it is lowest, but not far.

The file of explorations is the checkpoint: everything else follows from it and from the seed.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import os
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from layoutexplore.agents.base import Heuristic
from layoutexplore.agents.rl.card import PolicySpec, read_card, spec_of
from layoutexplore.agents.rl.environments import plan_source
from layoutexplore.agents.rl.evaluation import read_evaluations
from layoutexplore.agents.rl.explorers import explorers
from layoutexplore.agents.rl.hyperparameters import TrainingConfig
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.agents.rl.run import EVALUATIONS, POLICY, TrainingRun, Watcher
from layoutexplore.agents.rl.tour_search.response_surface import fit_surface, lowest
from layoutexplore.envs.curriculum import Randomisation
from layoutexplore.envs.plans import PlanSource
from layoutexplore.errors import ResultsError, checks_arguments, shortened
from layoutexplore.files import atomic, parse_csv, read_text
from layoutexplore.files.reading import is_there
from layoutexplore.frontiers.decision import Decision, Predictor
from layoutexplore.frontiers.tour_features import TourConfig, greatest, tour_features
from layoutexplore.grids.arrays import Floats
from layoutexplore.metrics.exploration import score_curve
from layoutexplore.options import Options
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.simulation import Simulation

EXPLORATIONS = "explorations.csv"
"""Name of the checkpoint: a row an exploration."""

LOGARITHMIC = {"patience": 0.5, "most_area": 0.4, "little_left": 0.4}
"""Parameters that are multiplied by exp(scale z)."""

LINEAR = {"area_exponent": 0.25, "expected_exponent": 0.25, "first_leg": 0.3, "hold": 0.6}
"""Parameters to which scale z is added; never below 0."""

PARAMETERS = (*LOGARITHMIC, *LINEAR)

_FARTHEST = 1e9
_MOST = 1_000_000
_NEAR = 5.0
"""Metres added before a logarithm is taken, so that tiny buildings do not count more than others."""


class Exploration(NamedTuple):
    """One exploration of a search.

    Attributes:
        group: Those of one group explored the same floor plan with the same sensor from the same start.
        member: Its number in the group.
        d95: Metres until 95 % was seen.
        d99: Metres until 99 % was seen.
    """

    group: int
    member: int
    d95: float
    d99: float


class SearchRun(TrainingRun):
    """A search in its folder. Arguments and errors as for `TrainingRun`; the checkpoint is `EXPLORATIONS`.

    Attributes:
        explorations: All of them, group by group.
    """

    def __init__(
        self,
        config: TrainingConfig,
        folder: str | os.PathLike[str],
        *,
        device: str,
        resume: bool,
        watcher: Watcher,
    ) -> None:
        super().__init__(config, folder, EXPLORATIONS, device=device, resume=resume, watcher=watcher)
        assert config.search is not None
        self.search = config.search
        self.members = 2 * config.search.pairs
        self.explorations: list[Exploration] = []
        self._seconds = 0.0
        self._centres = [np.zeros(len(PARAMETERS))]
        PlanSource(plan_source(config))  # What cannot be explored is told before anything is written.
        if resume:
            self.explorations = read_explorations(self.folder / EXPLORATIONS, self.members)
            self.evaluations = read_evaluations(self.folder / EVALUATIONS, self.steps)
            self._seconds = _seconds_of(self.folder / POLICY)
        self.begin_folder()
        self._rewrite()

    @property
    def steps(self) -> int:
        """Explorations that have been learnt from."""
        return len(self.explorations)

    @property
    def seconds(self) -> float:
        """Seconds of search, those before it went on included as far as the policy's card tells of them."""
        return self._seconds

    @property
    def spec(self) -> PolicySpec:
        """What the policy reads, with the tour as it is now."""
        return spec_of(dataclasses.replace(self.config, tour=self.tour))

    @property
    def tour(self) -> TourConfig:
        """The tour at the centre, as it is now."""
        return _tour(self.config.tour, self._centre(self.steps // self.search.round))

    def train(self) -> None:
        """Search until all explorations are done or somebody asks to stop."""
        began = time.monotonic() - self._seconds
        with self.stop_on_signal(), explorers(self.config.workers) as executor:
            while not self.stopping:
                # The policy is another one only after a whole round, or after the last.
                within = self.steps % self.search.round and self.steps < self.config.steps
                if self.evaluation_is_due and not within:
                    self.evaluate()
                elif self.steps < self.config.steps:
                    self._round(executor)
                    self._seconds = time.monotonic() - began
                    self.save()
                else:
                    break

    def draws(self, group: int) -> Floats:
        """The parameters z float64 (members, p) that a group explores, around the centre of its round."""
        centre = self._centre(group * self.members // self.search.round)
        rng = np.random.default_rng([self.config.seed, 1, group])
        steps = self.search.spread * rng.standard_normal((self.search.pairs, len(PARAMETERS)))
        around: Floats = centre + np.concatenate([steps, -steps])
        return around

    def _centre(self, number: int) -> Floats:
        """Where the draws of a round lie around, float64 (p,); rounds before it must be complete."""
        while len(self._centres) <= number:
            count = len(self._centres) * self.search.round // self.members
            z = np.array(
                [[_effective(self.config.tour, draw) for draw in self.draws(group)] for group in range(count)]
            )
            surface = fit_surface(z, self._values(count))
            self._centres.append(
                lowest(surface, self._centres[-1], self.search.trust, _least(self.config.tour))
            )
        return self._centres[number]

    def _values(self, count: int) -> Floats:
        """What the explorations of the first groups cost: float64 (count, members), logarithms of metres."""
        metres = np.array([(e.d95, e.d99) for e in self.explorations[: count * self.members]])
        weights = np.array([self.config.reward["weight_95"], self.config.reward["weight_99"]])
        values = (np.log(metres + _NEAR) @ weights / weights.sum()).reshape(count, self.members)
        middle = values.mean(axis=1, keepdims=True)
        clipped: Floats = middle + np.clip(values - middle, -self.search.outlier, self.search.outlier)
        return clipped

    def _round(self, executor: Executor | None) -> None:
        """Explore until the next move of the centre, or until somebody asks to stop."""
        end = min((self.steps // self.search.round + 1) * self.search.round, self.config.steps)
        groups = range(self.steps // self.members, -(-end // self.members))
        jobs = (
            (self.config, group, [_tour(self.config.tour, z) for z in self.draws(group)]) for group in groups
        )
        with (self.folder / EXPLORATIONS).open("a", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            for group, found in zip(groups, _explored(executor, jobs), strict=True):
                rows = [Exploration(group, member, *metres) for member, metres in enumerate(found)]
                writer.writerows(rows)
                file.flush()
                self.explorations += rows
                self.watcher.advance(self.steps, self.config.steps)
                if self.stopping:
                    return

    def actor(self) -> Actor:
        """The network, which is not learnt here: it goes where the tour begins."""
        torch.manual_seed(self.config.seed)
        return Actor(spec_of(self.config)).eval()

    def _rewrite(self) -> None:
        """Write all explorations anew: what was cut off in the middle of a group is done again."""
        with atomic(self.folder / EXPLORATIONS) as path, path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(Exploration._fields)
            writer.writerows(self.explorations)


@checks_arguments
def read_explorations(path: str | os.PathLike[str], members: int) -> list[Exploration]:
    """The explorations of a search, whole groups only.

    Raises:
        ResultsError: There is no such file, or it is something else.
    """
    path = Path(path)
    if not is_there(path):
        raise ResultsError(f"no checkpoint {path}: leave out --resume to start a run there")
    text = read_text(path, ResultsError, "file of explorations")
    # What follows the last line break was cut off, or is nothing.
    lines = parse_csv(text[: text.rfind("\n") + 1], str(path))
    if not lines or lines[0] != list(Exploration._fields):
        raise ResultsError(f"{path} is not a file of explorations of layoutexplore train")
    if len(lines) > _MOST:
        raise ResultsError(f"{path} is damaged: it has {len(lines)} lines, and {_MOST} is the most")
    try:
        rows = [Exploration(int(a), int(b), float(c), float(d)) for a, b, c, d in lines[1:]]
    except ValueError as error:
        raise ResultsError(f"{path} is damaged: {shortened(str(error))}") from error
    if not all(0 <= metres <= _FARTHEST for row in rows for metres in (row.d95, row.d99)):
        raise ResultsError(f"{path} is damaged: metres must be from 0 to {_FARTHEST:g}")
    if any((row.group, row.member) != divmod(k, members) for k, row in enumerate(rows)):
        raise ResultsError(f"{path} does not fit this run's search.pairs, or is damaged")
    return rows[: len(rows) // members * members]


def _seconds_of(policy: Path) -> float:
    """How long a search has taken by the card of its policy; 0 where nothing tells."""
    with suppress(ResultsError):
        training = read_card(policy).get("training")
        minutes = training.get("minutes") if isinstance(training, dict) else None
        if isinstance(minutes, (int, float)) and 0 <= minutes < _FARTHEST:
            return 60.0 * minutes
    return 0.0


def explore_group(config: TrainingConfig, group: int, tours: list[TourConfig]) -> list[tuple[float, float]]:
    """Explore one floor plan from one start by several tours: the metres to 95 and to 99 % of each."""
    rng = np.random.default_rng([config.seed, 0, group])
    done = min(1.0, group * len(tours) / config.steps)  # The plans may grow with it.
    _, plan = PlanSource(plan_source(config)).draw(rng, done)
    simulation_config = Randomisation(sensors=config.sensors).draw(rng, SimulationConfig())
    simulation = Simulation(plan, simulation_config, _predictor(config.predictor))
    seed = int(rng.integers(2**31))
    return [_explore(simulation, seed, tour) for tour in tours]


class _TourAgent(Heuristic[Options]):
    """Goes where a tour begins."""

    def __init__(self, tour: TourConfig) -> None:
        super().__init__("tour", Options())
        self._tour = tour

    def choose(self, decision: Decision) -> int:
        """The index of the tour's first frontier."""
        return int(np.argmax(tour_features(decision, self._tour).rank))


def _explore(simulation: Simulation, seed: int, tour: TourConfig) -> tuple[float, float]:
    curve = play(simulation, _TourAgent(tour), seed=seed).curve
    scores = score_curve(curve, budget=simulation.max_distance, target_area=simulation.target_area)
    return scores.d95, scores.d99


def _tour(start: TourConfig, z: Floats) -> TourConfig:
    """The tour at z float64 (p,), where 0 is the start."""
    values = {}
    for name, offset in zip(PARAMETERS, z.tolist(), strict=True):
        value = getattr(start, name)
        if name in LOGARITHMIC:
            value *= math.exp(min(LOGARITHMIC[name] * offset, 100.0))
        else:
            value += LINEAR[name] * offset
        values[name] = min(max(value, 0.0), greatest(name))
    return TourConfig(**values)


def _least(start: TourConfig) -> Floats:
    """The least z float64 (p,) that makes a difference."""
    return np.array(
        [-np.inf if name in LOGARITHMIC else -getattr(start, name) / LINEAR[name] for name in PARAMETERS]
    )


def _effective(start: TourConfig, z: Floats) -> Floats:
    """The z float64 (p,) that works, where parameters below 0 are 0."""
    return np.maximum(z, _least(start))


@lru_cache(maxsize=4)
def _predictor(name: str) -> Predictor | None:
    return make_predictor(name)


def _explored(
    executor: Executor | None, jobs: Iterator[tuple[TrainingConfig, int, list[TourConfig]]]
) -> Iterator[list[tuple[float, float]]]:
    """The results of `explore_group` for each job, in order."""
    if executor is None:
        yield from (explore_group(*job) for job in jobs)
        return
    futures: list[Future[list[tuple[float, float]]]] = [executor.submit(explore_group, *job) for job in jobs]
    try:
        yield from (future.result() for future in futures)
    finally:
        for future in futures:
            future.cancel()
