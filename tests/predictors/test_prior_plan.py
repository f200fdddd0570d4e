"""The predictor `prior`: foresight when it is sure, the shipped predictor's word where it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError, LayoutExploreError, UnknownNameError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.grid import FREE, UNKNOWN
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from layoutexplore.predictors import make_predictor
from layoutexplore.predictors.learned import LearnedPredictor, LearnedRooms
from layoutexplore.predictors.prior_plan import SURE, PriorPredictor, owners_of, predictor_of_prior
from layoutexplore.priors.plan import PriorHints, prior_of_plan
from layoutexplore.priors.registration import Registration
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.saved_run import read_saved_run, save_simulation
from layoutexplore.simulation.simulation import Simulation
from tests.priors.cases import office


def decisions(predictor: PriorPredictor | None, count: int = 6) -> list[Decision]:
    """The first decisions of a robot that always goes to the nearest frontier."""
    simulation = Simulation(office(), SimulationConfig(sensor="indoor"), predictor)
    found = [simulation.reset(seed=3)]
    grids = []
    while len(found) < count and not simulation.done:
        grids.append(found[-1].grid.cells.copy())
        found.append(simulation.step(0))
    return found


def test_a_sure_plan_is_foreseen_and_what_was_seen_wins() -> None:
    predictor = predictor_of_prior("true;sure=0")
    simulation = Simulation(office(), SimulationConfig(sensor="stage"), predictor)
    decision = simulation.reset(seed=3)
    while decision.foresight is None and not simulation.done:
        decision = simulation.step(0)
    foreseen = decision.foresight
    assert foreseen is not None and decision.rooms is not None
    assert foreseen.hidden(decision.grid.cells).any()
    labels, passable = decision.rooms.labels, decision.rooms.labels > 0
    assert labels.shape == decision.grid.shape and passable.any()
    assert decision.table.closed.all() and (decision.table.expected_area >= 0).all()


def test_a_sketch_shows_what_is_foreseen_and_completes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    decision = decisions(predictor_of_prior("true;sure=0"))[-1]
    foreseen, rooms = decision.foresight, decision.rooms
    assert foreseen is not None and rooms is not None
    completed = rooms.labels
    with monkeypatch.context() as patched:
        patched.setattr(LearnedRooms, "rooms", property(lambda _: pytest.fail("rooms were completed")))
        fresh = decisions(predictor_of_prior("true;sure=0"))[-1].rooms
        assert fresh is not None
        sketch = fresh.sketch
    shown = (decision.grid.cells == UNKNOWN) & (foreseen.cells != UNKNOWN)
    assert sketch.shape == completed.shape and (sketch[shown] > 0).any()
    np.testing.assert_array_equal(sketch[shown] > 0, completed[shown] > 0)


@pytest.mark.parametrize("kind", ["empty", "true;sure=1"])
def test_without_belief_the_shipped_predictor_speaks(kind: str) -> None:
    predictor = predictor_of_prior(kind)
    for mine, shipped in zip(decisions(predictor), decisions(LearnedPredictor()), strict=True):
        assert mine.foresight is None
        for name in ("closed", "expected_area", "confidence"):
            assert np.array_equal(getattr(mine.table, name), getattr(shipped.table, name))


def test_to_be_asked_for_rooms_as_well_changes_nothing() -> None:
    def confidences(*, asks: bool) -> list[float]:
        predictor = predictor_of_prior("true")
        simulation = Simulation(office(), SimulationConfig(sensor="indoor"), predictor)
        decision, found = simulation.reset(seed=3), []
        for _ in range(4):
            if asks:
                predictor.rooms(decision)
            found.append(predictor.confidence)
            decision = simulation.step(0)
        return found

    assert confidences(asks=True) == confidences(asks=False) != [0.0] * 4


def test_the_seed_of_the_run_decides_the_plan() -> None:
    predictor = predictor_of_prior("rough")
    simulation = Simulation(office(), SimulationConfig(sensor="stage"), predictor)
    made = []
    for seed in (1, 2, 1):
        simulation.reset(seed=seed)
        assert predictor.registration is not None
        made.append(predictor.registration.prior.free)
    assert np.array_equal(made[0], made[2])
    assert made[0].shape != made[1].shape or not np.array_equal(made[0], made[1])


def test_a_file_of_its_own(tmp_path: Path) -> None:
    save_plan(office(), tmp_path / "plan.geojson")
    predictor = make_predictor(f"prior:{tmp_path / 'plan.geojson'};scale=1;rotation=0;mirror=no")
    assert isinstance(predictor, PriorPredictor)
    assert predictor.fingerprint != predictor_of_prior("true").fingerprint
    simulation = Simulation(office(), SimulationConfig(sensor="stage"), predictor)
    decision = simulation.reset(seed=0)
    for _ in range(12):
        if simulation.done or decision.foresight is not None:
            break
        decision = simulation.step(0)
    assert predictor.confidence > SURE


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("true;scala=2", "scala"),
        ("true;scale=wide", "scale must be a number"),
        ("true;mirror=maybe", "mirror is yes or no"),
        ("true;here=3", "here is X/Y"),
        ("true;sure=7", "sure is a probability"),
        ("nowhere.png", "no such file"),
        ("offices-01", "unknown plan"),
    ],
)
def test_nonsense_is_refused(text: str, message: str) -> None:
    with pytest.raises(LayoutExploreError, match=message):
        predictor_of_prior(text)


@pytest.mark.parametrize("key", ["scale", "mirror", "here", "sure"])
def test_a_wrong_hint_of_any_length_is_told_shortly(key: str) -> None:
    with pytest.raises(ConfigError) as told:
        predictor_of_prior(f"true;{key}={'1/' * 9000}")
    assert key in str(told.value) and len(str(told.value)) < 600


def test_hints_that_nothing_would_hear_are_refused() -> None:
    told = PriorHints(rotation=90.0)
    for source in ("rough", prior_of_plan(office(), told)):
        with pytest.raises(ConfigError, match="hints are told of"):
            PriorPredictor(source, told)
    with pytest.raises(ConfigError, match="a preset takes none"):
        predictor_of_prior("true;mirror=yes")
    assert PriorPredictor(prior_of_plan(office(), told), PriorHints()).registration is not None


def test_a_plan_believed_at_any_confidence_still_needs_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no place for the plan is found, the shipped predictor speaks."""
    monkeypatch.setattr(Registration, "update", lambda registration, grid: None)
    save_plan(office(), tmp_path / "plan.geojson")
    predictor = make_predictor(f"prior:{tmp_path / 'plan.geojson'};sure=0")
    decision = Simulation(office(), SimulationConfig(sensor="stage"), predictor).reset(seed=0)
    assert decision.foresight is None and decision.rooms is not None


def test_a_plan_that_is_nothing_by_its_scale_is_not_used(tmp_path: Path) -> None:
    save_plan(office(), tmp_path / "plan.geojson")
    predictor = make_predictor(f"prior:{tmp_path / 'plan.geojson'};scale=0.0000001")
    assert isinstance(predictor, PriorPredictor) and "check its unit" in predictor.unused


def test_before_a_run_begins_a_preset_knows_nothing() -> None:
    decision = decisions(None, 1)[0]
    mine, shipped = (p.predict(decision) for p in (predictor_of_prior("true"), LearnedPredictor()))
    assert mine.foresight is None and np.array_equal(mine.table.closed, shipped.table.closed)


def test_other_floors_have_to_be_named() -> None:
    predictor = predictor_of_prior("other-floor")
    simulation = Simulation(office(), SimulationConfig(), predictor)
    with pytest.raises(ConfigError, match="among=FOLDER"):
        simulation.reset(seed=0)
    with pytest.raises((UnknownNameError, LayoutExploreError)):
        Simulation(office(), SimulationConfig(), predictor_of_prior("wrong;among=nowhere/")).reset(seed=0)


@pytest.mark.parametrize("agent", ["plan-tour", "layout-tour"])
def test_a_run_goes_on_as_if_it_had_not_been_stopped(agent: str, tmp_path: Path) -> None:
    """`layout-tour` remembers nothing itself: then the predictor alone has to be asked again."""

    def explored(pause: int) -> tuple[list[tuple[float, ...]], float]:
        predictor, explorer = predictor_of_prior("true"), make_agent(agent)
        simulation = Simulation(office(), SimulationConfig(sensor="indoor"), predictor)
        decision = simulation.reset(seed=1)
        explorer.reset(1)
        while not simulation.done and simulation.decisions < 9:
            decision = simulation.step(explorer.act(decision))
            if simulation.decisions == pause:
                save_simulation(simulation, tmp_path / "run.npz")
                predictor, explorer = predictor_of_prior("true"), make_agent(agent)
                simulation = Simulation(office(), SimulationConfig(sensor="indoor"), predictor)
                decision = read_saved_run(tmp_path / "run.npz").restore(simulation, explorer)
        return simulation.track.tolist(), predictor.confidence

    assert explored(pause=5) == explored(pause=-1)


def test_foreseen_rooms_that_are_seen_as_one_are_judged_apart() -> None:
    seen = np.full((3, 12), UNKNOWN, np.int8)
    seen[:, 3:8] = FREE
    rooms = np.where(np.arange(12) < 6, 1, 2).astype(np.int32) * np.ones((3, 1), np.int32)
    foreseen = Foresight(
        cells=np.zeros((3, 12), np.int8), room_ids=rooms, confidence=1.0, predictor="prior", resolution=0.1
    )
    sketch = np.where(seen == FREE, 4, 0).astype(np.int32)
    assert owners_of(sketch, foreseen, seen).tolist() == [0, 4, 4], "one room is drawn"
    owner = owners_of(sketch, foreseen, seen, alone=True).tolist()
    assert owner[:2] == [0, 4] and owner[2] > 4, "most of what is seen is of the first"
    nothing = owners_of(np.zeros_like(sketch), foreseen, seen, alone=True).tolist()
    assert nothing[0] == 0 and len(set(nothing)) == 3


def test_a_preset_of_another_floor_is_known_by_the_files_it_is_chosen_from(tmp_path: Path) -> None:
    def prints() -> list[str]:
        return [predictor_of_prior(f"{kind};among={tmp_path}").fingerprint for kind in ("wrong", "true")]

    save_plan(load_plan("apartment-01"), tmp_path / "floor.geojson")
    first = prints()
    assert first[0] != predictor_of_prior("wrong").fingerprint and prints() == first
    save_plan(load_plan("apartment-02"), tmp_path / "other.geojson")
    assert prints()[0] != first[0] and prints()[1] == first[1]


def test_results_with_words_that_were_read_are_told_from_those_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the picture of a rough plan words are erased by Tesseract where it is, else by their size."""
    prints = {}
    for there in (False, True):
        monkeypatch.setattr("layoutexplore.priors.presets.has_ocr", lambda there=there: there)
        for kind in ("rough", "true"):
            prints[kind, there] = predictor_of_prior(kind).fingerprint
    assert prints["rough", True] != prints["rough", False]
    assert prints["true", True] == prints["true", False]
