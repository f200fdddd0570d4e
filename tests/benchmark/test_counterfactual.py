"""What a layout changed in a run: asked beside it, without touching it."""

from __future__ import annotations

import copy
import dataclasses
import math
import random
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.agents import describe_agents
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.counterfactual import (
    MOST_DECISIVE,
    CounterfactualRollouts,
    DecisiveDecision,
    same_choice,
    without_layout,
)
from layoutexplore.benchmark.layout_effects import layout_effects
from layoutexplore.benchmark.recording import from_arrays, to_arrays
from layoutexplore.benchmark.rows import Row, prepare
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.cli import app
from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import STOP, Agent, Choice, Decision
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.geojson import save_plan
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import Episode, TimedPredictor, play
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices
from tests.plugins.cases import AGENT as AGENT_OF_ONES_OWN
from tests.plugins.cases import write

PREDICTS = "    predictor = 'oracle'\n\n    def __init__"
AGENT = "layout-nearest:predictor=oracle:flip=0.25"


@pytest.fixture(scope="module")
def plan() -> FloorPlan:
    return offices()


def run(plan: FloorPlan, agent: str, *, explain: bool, seed: int = 0) -> Episode:
    return play(
        *prepare(plan, SimulationConfig(sensor="stage"), agent),
        seed=seed,
        probe=CounterfactualRollouts if explain else None,
    )


class Fixed:
    """Answers with what it was told, and counts how often it was asked: it has a memory."""

    name = "fixed"

    def __init__(self, with_layout: Choice, without: Choice) -> None:
        self.answers = (with_layout, without)
        self.asked = 0

    def reset(self, seed: int) -> None:
        self.asked = 0

    def act(self, decision: Decision) -> Choice:
        self.asked += 1
        return self.answers[decision.frontiers[0].is_closed is None]


def test_the_run_goes_on_as_if_nobody_had_asked(plan: FloorPlan) -> None:
    asked, silent = (run(plan, AGENT, explain=explain) for explain in (True, False))
    assert np.array_equal(asked.curve, silent.curve) and np.array_equal(asked.track, silent.track)
    assert silent.notes is None and asked.notes is not None
    assert len(asked.notes.log) == len(asked.decision_ms) == len(asked.prediction_ms)


class Gambler(Fixed):
    """Takes the random numbers of the process, and cannot do what its mood says."""

    def __init__(self, mood: str = "") -> None:
        self.mood = mood

    def reset(self, seed: int) -> None:
        random.seed(seed)
        np.random.seed(seed)  # noqa: NPY002
        if self.mood == "holds a generator":
            self.numbers = (number for number in range(10**6))
        if self.mood == "deals badly":
            self.lock = Lock()

    def act(self, decision: Decision) -> Choice:
        if decision.frontiers and decision.frontiers[0].is_closed is None:
            if self.mood == "fails without":
                raise ZeroDivisionError
            if self.mood == "quits without":
                sys.exit()
            if self.mood == "no choice without":
                return None  # type: ignore[return-value]
        count = len(decision.frontiers)
        gambled = random.randrange(2**20) + np.random.randint(2**20)  # noqa: NPY002
        return gambled % count if count else STOP


class Lock:
    """Takes random numbers while it is copied."""

    def __deepcopy__(self, memo: object) -> Lock:
        random.random()
        return Lock()


@pytest.mark.parametrize(
    ("mood", "answers"),
    [
        ("", True),
        ("deals badly", True),
        ("holds a generator", False),
        ("fails without", False),
        ("quits without", False),
        ("no choice without", False),
    ],
)
def test_own_agents_are_asked_without_touching_them(plan: FloorPlan, mood: str, answers: bool) -> None:
    def episode(*, explain: bool) -> Episode:
        predictor = TimedPredictor(make_predictor("oracle:flip=0.25"))  # type: ignore[arg-type]
        simulation = Simulation(plan, SimulationConfig(sensor="stage"), predictor)
        return play(simulation, Gambler(mood), probe=CounterfactualRollouts if explain else None)

    asked, silent = episode(explain=True), episode(explain=False)
    assert np.array_equal(asked.track, silent.track)
    assert (asked.notes is not None) == answers
    if answers:  # it gambles with the same numbers when it is asked again
        assert not asked.notes.column("changed").any() and not asked.notes.column("misled").any()


def test_who_gives_no_answer_is_told_once(plan: FloorPlan, tmp_path: Path) -> None:
    save_plan(plan, tmp_path / "offices.geojson")
    text = AGENT_OF_ONES_OWN.replace("pass", "self.numbers = iter(x for x in [])")
    mine = f"{write(tmp_path, text.replace('    def __init__', PREDICTS))}:Mine"
    config = BenchmarkConfig(plans=(str(tmp_path / "offices.geojson"),), starts=2, agents=("nearest", mine))
    done = run_benchmark(config, tmp_path / "out")
    (told,) = done.warnings
    assert told.startswith(mine) and "cannot be copied" in told and not done.failed
    assert [math.isnan(row.layout_changed) for row in done.rows] == [row.agent == mine for row in done.rows]
    words = ["benchmark", "--plans", str(tmp_path / "offices.geojson"), "--agents", mine, "--jobs", "1"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "again"), "--starts", "1"])
    assert result.exit_code == 0 and result.output.count("cannot be copied") == 1


def test_agents_without_a_predictor_are_not_asked(plan: FloorPlan) -> None:
    episode = run(plan, "nearest", explain=True)
    assert episode.notes is None and episode.prediction_ms == []


def test_the_oracle_is_never_wrong_nor_misled(plan: FloorPlan) -> None:
    told = run(plan, "layout-nearest:predictor=oracle", explain=True).notes
    assert told is not None
    for name in ("misled", "closed_as_open", "open_as_closed", "leftover_missed", "leftover_wrong"):
        assert not told.column(name).any()
    assert (told.column("closed") + told.column("open") == told.column("frontiers")).all()
    assert told.column("changed").any() and all(moment.right for moment in told.decisive)


def test_without_the_layout_nothing_is_foreseen_and_the_truth_foresees_as_far(plan: FloorPlan) -> None:
    agent = "plan-tour:predictor=oracle:horizon=1"
    simulation, _ = prepare(plan, SimulationConfig(sensor="stage"), agent)
    decision = simulation.reset(seed=0)
    assert decision.foresight is not None and without_layout(decision).foresight is None
    told = run(plan, agent, explain=True).notes
    assert told is not None and told.column("changed").any() and not told.column("misled").any()


def test_flipped_classes_are_counted(plan: FloorPlan) -> None:
    told = run(plan, AGENT, explain=True).notes
    assert told is not None
    assert told.column("closed_as_open").sum() + told.column("open_as_closed").sum() > 0
    assert (told.column("leftover_missed") <= told.column("leftover")).all()
    reasons = told.column("class_alone") + told.column("area_alone") + told.column("both")
    assert (reasons[told.column("misled") == 0] == 0).all()


def test_changed_is_another_choice_without_the_layout(plan: FloorPlan) -> None:
    simulation, _ = prepare(plan, SimulationConfig(sensor="stage"), AGENT)
    decision = simulation.reset(seed=0)
    assert len(decision.frontiers) >= 2
    for pair, changed in (((0, 0), 0.0), ((1, 0), 1.0), ((0, STOP), 1.0), ((STOP, STOP), 0.0)):
        agent, asides = Fixed(*pair), CounterfactualRollouts(simulation)
        asides.before(agent)
        choice = agent.act(decision)
        asides.note(decision, choice, 1.5)
        told = asides.end()
        assert told.column("changed").tolist() == [changed] and told.column("prediction_ms").tolist() == [1.5]
        assert agent.asked == 1 and len(told.decisive) == (pair == (1, 0))


def test_moments_within_two_metres_are_about_the_same(plan: FloorPlan) -> None:
    told = run(plan, AGENT, explain=True).notes
    assert told is not None and told.decisive
    moment, (row, col) = told.decisive[0], told.decisive[0].chosen
    for cells, same in ((20, True), (21, False)):
        assert moment.is_about(dataclasses.replace(moment, chosen=(row + cells, col)), 0.1) == same
        assert (
            moment.is_about(
                dataclasses.replace(moment, given_up=(moment.given_up[0], moment.given_up[1] - cells)), 0.1
            )
            == same
        )
    for k, other in enumerate(told.decisive):
        assert all(not other.is_about(later, 0.1) for later in told.decisive[k + 1 :])


def test_a_hidden_layout_leaves_nothing(plan: FloorPlan) -> None:
    simulation, _ = prepare(plan, SimulationConfig(sensor="stage"), "layout-nearest")
    decision = simulation.reset(seed=0)
    assert decision.rooms is not None and decision.frontiers[0].is_closed is not None
    bare = simulation.predictor
    simulation.predictor = None
    plain, hidden = simulation.reset(seed=0), without_layout(decision)
    simulation.predictor = bare
    assert hidden.rooms is None
    for a, b in zip(plain.frontiers, hidden.frontiers, strict=True):
        ours, theirs = dataclasses.asdict(a), dataclasses.asdict(b)
        assert all(np.array_equal(ours[key], theirs[key]) for key in ours)


@pytest.mark.parametrize(
    "name", [a.name for a in describe_agents() if any(key == "predictor" for key, _, _ in a.parameters)]
)
def test_every_layout_agent_can_do_without(plan: FloorPlan, name: str) -> None:
    simulation, agent = prepare(plan, SimulationConfig(sensor="stage"), name)
    decision = simulation.reset(seed=0)
    agent.reset(0)
    twin = copy.deepcopy(agent)
    choice = twin.act(without_layout(decision))
    assert isinstance(choice, np.ndarray) or choice == STOP or 0 <= choice < len(decision.frontiers)
    assert same_choice(agent.act(decision), copy.deepcopy(agent).act(decision)) or name == "random"


def test_moments_say_what_came_of_them(plan: FloorPlan) -> None:
    count = 0
    for seed in range(3):
        told = run(plan, AGENT, explain=True, seed=seed).notes
        assert told is not None and len(told.decisive) <= MOST_DECISIVE
        assert [m.distance for m in told.decisive] == sorted(m.distance for m in told.decisive)
        for moment in told.decisive:
            assert moment.stake >= -1e-3 and 0 <= moment.without < len(moment.judged)
            assert math.isnan(moment.seen_after) or moment.seen_after >= 0
            rows, cols = (moment.members - moment.corner).T
            assert (moment.cells[rows, cols] == 0).all()  # frontiers are free cells of the part that is kept
        count += len(told.decisive)
    assert count


class Walking:
    """Goes where another agent goes by paths of its own, unless the layout is hidden."""

    name = "walking"

    def __init__(self, inner: Agent) -> None:
        self.inner, self.reset = inner, inner.reset

    def act(self, decision: Decision) -> Choice:
        choice = self.inner.act(decision)
        path = decision.field.path_to(decision.frontiers[choice].viewpoint)
        return path if decision.frontiers[0].is_closed is not None and len(path) > 1 else choice


def test_who_goes_back_by_a_path_goes_back(plan: FloorPlan) -> None:
    simulation, agent = prepare(plan, SimulationConfig(sensor="stage"), "layout-tour:predictor=oracle")
    notes = play(simulation, Walking(agent), seed=1, probe=CounterfactualRollouts).notes
    assert notes is not None and len(notes.decisive) > 1
    assert any(decided.came_back for decided in notes.decisive)


def test_what_is_kept_survives_the_file(plan: FloorPlan, tmp_path: Path) -> None:
    episode = run(plan, AGENT, explain=True)
    told = episode.notes
    assert told is not None and told.decisive
    folder, row = ResultsFolder(tmp_path), Row(plan="a", start=0, sensor="stage", agent=AGENT, seed=0)
    folder.save_episode(row, episode)
    for read in (folder.counterfactual(row), from_arrays(to_arrays(told))):
        assert read is not None and np.array_equal(read.log, told.log)
        for a, b in zip(read.decisive, told.decisive, strict=True):
            for f in dataclasses.fields(DecisiveDecision):
                mine, theirs = getattr(a, f.name), getattr(b, f.name)
                assert np.array_equal(mine, theirs, equal_nan=isinstance(mine, float)), f.name
    folder.save_episode(row, dataclasses.replace(episode, notes=None))
    assert folder.counterfactual(row) is None


def test_rows_and_effects(plan: FloorPlan, tmp_path: Path) -> None:
    save_plan(plan, tmp_path / "offices.geojson")
    config = BenchmarkConfig(plans=(str(tmp_path / "offices.geojson"),), starts=2, agents=("nearest", AGENT))
    outcome = run_benchmark(config, tmp_path / "out")
    rows = {(row.agent, row.start): row for row in outcome.rows}
    assert rows["nearest", 0].layout_changed == rows["nearest", 0].prediction_seconds == 0.0
    assert rows[AGENT, 0].prediction_seconds > 0 and 0 < rows[AGENT, 0].layout_changed < 1
    (effect,) = layout_effects(outcome.rows, outcome.folder.log)
    mine = [rows[AGENT, start] for start in (0, 1)]
    assert (effect.agent, effect.runs, effect.decisions) == (AGENT, 2, sum(row.decisions for row in mine))
    assert effect.changed.estimate == pytest.approx(np.mean([row.layout_changed for row in mine]), abs=1e-6)
    assert (
        effect.by_class + effect.by_area + effect.by_both + effect.by_rooms >= 1 - 1e-9
        or effect.misled.estimate == 0
    )
    quiet = run_benchmark(dataclasses.replace(config, explain=False), tmp_path / "quiet")
    assert math.isnan({row.agent: row for row in quiet.rows}[AGENT].layout_changed)
    assert layout_effects(quiet.rows, quiet.folder.log) == []
    assert [row.d99 for row in quiet.rows] == [row.d99 for row in outcome.rows]


def test_explain_is_yes_or_no() -> None:
    with pytest.raises(ConfigError, match="true or false"):
        BenchmarkConfig(explain="maybe")  # type: ignore[arg-type]


def test_the_command_can_do_without(plan: FloorPlan, tmp_path: Path) -> None:
    save_plan(plan, tmp_path / "offices.geojson")
    arguments = [
        "benchmark",
        "--plans",
        str(tmp_path / "offices.geojson"),
        "--starts",
        "1",
        "--agents",
        AGENT,
        "--jobs",
        "1",
    ]
    for flag, asked in (("--no-explain", False), ("--explain", True)):
        out = tmp_path / flag
        result = CliRunner().invoke(app, [*arguments, "--out", str(out), flag])
        assert result.exit_code == 0, result.output
        (row,) = ResultsFolder(out).rows()
        assert math.isnan(row.layout_changed) != asked
        assert (ResultsFolder(out).counterfactual(row) is not None) == asked


def test_drift_beyond_the_grid_is_survived(plan: FloorPlan) -> None:
    """A robot that believes to be outside of its map is still asked."""
    config = SimulationConfig(
        sensor="indoor", odometry_noise=OdometryNoise(translation=0.5, rotation=0.5), max_distance=40.0
    )
    for seed in range(3):
        told = play(*prepare(plan, config, AGENT), seed=seed, probe=CounterfactualRollouts).notes
        assert told is not None and len(told.log)


def test_results_of_an_earlier_version_are_read(plan: FloorPlan, tmp_path: Path) -> None:
    save_plan(plan, tmp_path / "offices.geojson")
    config = BenchmarkConfig(plans=(str(tmp_path / "offices.geojson"),), starts=1, agents=("nearest",))
    folder = run_benchmark(config, tmp_path / "out").folder
    import pandas as pd

    table = pd.read_csv(folder.table, keep_default_na=False, dtype=str)
    table.drop(columns=["layout_changed", "layout_misled", "prediction_seconds"]).to_csv(
        folder.table, index=False
    )
    (row,) = folder.rows()
    assert row.reached99 and math.isnan(row.layout_changed)
    assert run_benchmark(config, tmp_path / "out").ran == 0
    assert set(table.columns) == set(pd.read_csv(folder.table).columns)
