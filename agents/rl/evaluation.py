"""How good a policy is: explorations on fixed cells, paired with reference agents in the same cells."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm

from layoutexplore.agents import make_agent
from layoutexplore.agents.rl.environments import environment_arguments
from layoutexplore.agents.rl.explorers import Stop, explore_all
from layoutexplore.agents.rl.hyperparameters import MOST_CELLS, TrainingConfig
from layoutexplore.errors import (
    ConfigError,
    ResultsError,
    checks_arguments,
    checks_making,
    counted,
    shortened,
)
from layoutexplore.files import read_csv
from layoutexplore.files.reading import is_there
from layoutexplore.files.schema import Items, Number, Record
from layoutexplore.frontiers.decision import Agent, predictor_of
from layoutexplore.maps.library import cached_plan, find_plans
from layoutexplore.metrics.exploration import score_curve
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play, run_seed, start_pose
from layoutexplore.simulation.simulation import Simulation

_NUMBER = Number(low=-1e12, high=1e12)
EVALUATION = Record({"steps": Number(low=0, high=1e12), "score": _NUMBER}, others=_NUMBER)
"""What is kept of an evaluation: numbers by name."""


class EvaluationCell(NamedTuple):
    """One exploration of an evaluation: a floor plan, the number of a start on it, and the sensor."""

    plan: str
    start: int
    sensor: str


class Metres(NamedTuple):
    """Metres until 95 % and until 99 % was seen, and the share seen at the end."""

    d95: float
    d99: float
    coverage: float


@checks_arguments
def check_what_is_named(config: TrainingConfig) -> None:
    """See that every agent and predictor that a run names is there, before anything begins.

    Raises:
        ConfigError: There is no such agent or predictor, or they do not go together.
    """
    make_predictor(config.predictor)
    for name in config.evaluation.references:
        make_agent(name)
    teacher = config.imitation.teacher if config.imitation else ""
    wanted = getattr(make_agent(teacher), "predictor", config.predictor) if teacher else config.predictor
    if wanted != config.predictor:
        raise ConfigError(
            f"the teacher {teacher!r} needs predictor = {wanted!r}, the run has {config.predictor!r}"
        )


@checks_making
class Evaluation:
    """Explores the cells of a configuration; what the reference agents do is found once.

    Args:
        config: Of the run.

    Raises:
        ConfigError: It would never end.
        MapError: There is no such plan.
    """

    def __init__(self, config: TrainingConfig) -> None:
        self.config = config
        plans = find_plans(config.evaluation.plans)
        starts = range(config.evaluation.starts)
        if (count := len(plans) * len(starts) * len(config.sensors)) > MOST_CELLS:
            raise ConfigError(
                f"an evaluation explores {MOST_CELLS} times at most, got {count}: take fewer of "
                "evaluation.plans, evaluation.starts or sensors"
            )
        self.cells = [
            EvaluationCell(plan, start, sensor)
            for plan in plans
            for start in starts
            for sensor in config.sensors
        ]
        self._references: dict[str, list[Metres]] = {}

    @property
    def sentence(self) -> str:
        """What the first evaluation takes, for whoever waits for it."""
        agents = ", ".join(("the policy", *self.config.evaluation.references))
        count = counted(len(self.cells) * (1 + len(self.config.evaluation.references)), "exploration")
        plans = ", ".join(self.config.evaluation.plans)
        return f"the first evaluation, before anything is learnt: {count} of {plans} by {agents}"

    def compare(self, agent: Agent, stop: Stop = lambda: False) -> dict[str, float]:
        """The scores of an agent.

        Args:
            agent: Who explores.
            stop: Asked after every decision whether to give up.

        Returns:
            `d95` and `d99` (mean metres), `coverage`, and `d95_ratio.NAME`, `d99_ratio.NAME` for every
            reference: the geometric mean of the ratios over the cells, below 1 where the agent is better.
            Empty when given up.
        """
        references = self.config.evaluation.references
        unknown = [name for name in references if name not in self._references]
        agents: list[Agent | str] = [*unknown, agent]
        jobs = [(who, cell) for who in agents for cell in self.cells]
        found = explore_all(_explore, jobs, stop, self.config.workers)
        if len(found) < len(jobs) or stop():
            return {}
        parts = [found[k : k + len(self.cells)] for k in range(0, len(found), len(self.cells))]
        self._references |= dict(zip(unknown, parts, strict=False))
        metres = parts[-1]
        scores = {"d95": _mean(m.d95 for m in metres), "d99": _mean(m.d99 for m in metres)}
        scores["coverage"] = _mean(m.coverage for m in metres)
        for name in references:
            pairs = list(zip(metres, self._references[name], strict=True))
            scores[f"d95_ratio.{name}"] = float(np.exp(_mean(np.log(a.d95 / b.d95) for a, b in pairs)))
            scores[f"d99_ratio.{name}"] = float(np.exp(_mean(np.log(a.d99 / b.d99) for a, b in pairs)))
        return scores


def _explore(job: tuple[Agent | str, EvaluationCell], stop: Stop) -> Metres:
    """Explore a cell as an agent, or as one of a name; of what is given up, the metres mean nothing."""
    agent, cell = job
    if isinstance(agent, str):
        agent = make_agent(agent)
    plan, config = cached_plan(cell.plan), SimulationConfig(sensor=cell.sensor)
    simulation = Simulation(plan, config, make_predictor(predictor_of(agent)))
    start, seed = start_pose(plan, config, 0, cell.start), run_seed(0, plan.name, cell.start)
    episode = play(simulation, agent, seed=seed, start=start, until=lambda _: stop())
    curve = score_curve(episode.curve, budget=simulation.max_distance, target_area=simulation.target_area)
    return Metres(max(curve.d95, 0.1), max(curve.d99, 0.1), simulation.coverage)


def score(scores: dict[str, float], references: tuple[str, ...]) -> float:
    """One number to choose the best policy by, smaller is better.

    With references, the geometric mean of the ratios at 95 and 99 % to the first one; without, the share that
    was not seen.
    """
    if not references:
        return 1.0 - scores["coverage"]
    name = references[0]
    return float(np.sqrt(scores[f"d95_ratio.{name}"] * scores[f"d99_ratio.{name}"]))


@checks_arguments
def read_evaluations(path: str | os.PathLike[str], steps: float = np.inf) -> list[dict[str, float]]:
    """What evaluations found up to a step, oldest first; nothing where there is no such file.

    Raises:
        ResultsError: The file is something else.
    """
    path = Path(path)
    if not is_there(path):
        return []
    header, *lines = read_csv(path, what="table of evaluations") or [[]]
    try:
        if lacking := [name for name in ("steps", "score") if name not in header]:
            raise ValueError(f"there is no column {lacking[0]}")
        if len(set(header)) < len(header):
            raise ValueError("two columns have the same name")
        rows = [
            {key: float(value) for key, value in zip(header, line, strict=True) if value} for line in lines
        ]
        fitted: list[dict[str, float]] = Items(EVALUATION).fit(rows, "evaluations")
        return [row for row in fitted if row["steps"] <= steps]
    except ValueError as error:
        raise ResultsError(
            f"{path} is damaged: {shortened(str(error))}; remove it to go on without the evaluations so far"
        ) from error


def curve_table(evaluations: Sequence[Mapping[str, float]]) -> str:
    """The curve of a run as a Markdown table, a row an evaluation, with the columns of the last one.

    Example:
        >>> print(curve_table([{"steps": 64.0, "score": 1.0, "d95": 61.0, "d95_ratio.nearest": 1.25}]))
        | steps | d95 | d95 / nearest |
        |--:|--:|--:|
        | 64 | 61.0 | 1.250 |
    """
    names = [name for name in evaluations[-1] if name != "score"] if evaluations else ["steps"]
    heads = [name.replace("_ratio.", " / ") for name in names]
    rows = [[_shown(name, evaluation.get(name)) for name in names] for evaluation in evaluations]
    lines = [heads, *rows]
    table = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join([table[0], "|" + "--:|" * len(names), *table[1:]])


def _shown(name: str, value: float | None) -> str:
    """A number of an evaluation: steps whole, metres to 0.1, ratios and shares to 0.001."""
    if value is None:
        return ""
    digits = 0 if name == "steps" else 3 if "ratio" in name or name == "coverage" else 1
    return f"{value:.{digits}f}"


def evaluate_motion(model: BaseAlgorithm, config: TrainingConfig, stop: Stop) -> dict[str, float]:
    """Mean coverage and metres of episodes of Motion-v0, one a start on every plan; empty when given up."""
    coverage, distance = [], []
    for plan in find_plans(config.evaluation.plans):
        env = gymnasium.make(config.environment, **{**environment_arguments(config), "plan": plan})
        for start in range(config.evaluation.starts):
            observation, info = env.reset(seed=start)
            over = False
            while not over:
                if stop():
                    return {}
                action, _ = model.predict(observation, deterministic=True)
                observation, _, terminated, truncated, info = env.step(action)
                over = terminated or truncated
            coverage.append(info["coverage"])
            distance.append(info["distance"])
        env.close()
    return {"coverage": _mean(coverage), "distance": _mean(distance)}


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))
