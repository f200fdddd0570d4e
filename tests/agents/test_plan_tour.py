"""Routes over foreseen space: a case worked out by hand, plans that are wrong, and following changes."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.agents.foreseen_floor import SAMPLE, SCAN_SPACING, ForeseenFloor, floor_in_view
from layoutexplore.agents.omniscient.places import Places
from layoutexplore.agents.omniscient.visibility import Visibility, size
from layoutexplore.frontiers.decision import Decision, Truth, Walk
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.frontiers.viewpoints import remaining_share
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import OraclePredictor, make_predictor
from layoutexplore.predictors.robot_map import RobotMap
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.plans import offices

CORRIDOR = "\n".join(["#" * 42, "#" + "a" * 40 + "#", "#" + "a" * 40 + "#", "#" * 42])
"""40 m by 2 m at a metre a letter."""

FAR_ROOMS = "\n".join(
    [
        "#" * 42,
        *["#bbbb" + "#" * 32 + "cccc#"] * 2,
        "##.##" + "#" * 32 + "##.##",
        *["#" + "a" * 40 + "#"] * 2,
        "#" * 42,
    ]
)
"""A room at either end of a corridor that is seen at once."""


class Drawn:
    """Foresees what a function makes of the true cells, whatever is true."""

    name = "drawn"

    def __init__(self, draw: Callable[[Cells], Cells], confidence: float = 1.0) -> None:
        self._draw, self._confidence = draw, confidence

    def reveal(self, truth: Truth) -> None:
        """Receive the truth of the run that begins."""
        self._cells = self._draw(np.where(truth.raster.occupied, OCCUPIED, FREE).astype(np.int8))

    def predict(self, decision: Decision) -> Decision:
        """The decision with foresight."""
        foresight = Foresight(
            cells=self._cells,
            room_ids=np.zeros(self._cells.shape, np.int32),
            confidence=self._confidence,
            predictor=self.name,
            resolution=decision.grid.resolution,
        )
        return dataclasses.replace(decision, foresee=lambda: foresight)


def explore(
    plan: FloorPlan, agent: str, predictor: object, sensor: str = "indoor", start: Pose | None = None
) -> Simulation:
    simulation = Simulation(plan, SimulationConfig(sensor=sensor), predictor)  # type: ignore[arg-type]
    strategy = make_agent(agent)
    decision = simulation.reset(seed=3, start=start)
    strategy.reset(3)
    while not simulation.done:
        decision = simulation.step(strategy.act(decision))
        assert simulation.decisions < 400
    return simulation


@functools.cache
def unforeseen(agent: str, sensor: str = "indoor") -> Simulation:
    """A run in the offices to which nothing is told, at its end."""
    return explore(offices(), agent, None, sensor)


def test_the_short_arm_comes_first_when_both_ends_are_foreseen() -> None:
    """Sight is 5 m: the left end is seen 7 m from the start, the right one 30 m from there; 37 m in all.

    The other way round it would be 23 m and 30 m, and 53 m in all.
    """
    plan = floorplan_from_ascii(CORRIDOR, resolution=1.0)
    simulation = explore(plan, "plan-tour", OraclePredictor(horizon=np.inf), "short", Pose(13.0, 2.0))
    xs = simulation.track[:, 0]
    assert xs.argmin() < xs.argmax()
    assert 34.0 < simulation.distance < 38.0


def test_a_long_way_back_through_what_is_known_gives_up_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the rooms the robot decides every half metre, 35 m long, and sees nothing new."""
    given_up: list[int] = []
    give_up = ForeseenFloor.give_up
    monkeypatch.setattr(
        ForeseenFloor,
        "give_up",
        lambda floor, bits: (given_up.append(size(bits & ~floor.seen)), give_up(floor, bits)),
    )
    plan = floorplan_from_ascii(FAR_ROOMS, resolution=1.0)
    simulation = explore(plan, "plan-tour", OraclePredictor(horizon=np.inf), "stage", Pose(17.0, 2.0))
    assert simulation.coverage >= 0.99 and sum(given_up) < 10  # a room is some 160 cells


def test_foresight_saves_metres() -> None:
    rooms_known = explore(offices(), "layout-tour", make_predictor("oracle"))
    all_known = explore(offices(), "plan-tour", make_predictor("oracle:horizon=inf"))
    assert all_known.distance < 0.9 * rooms_known.distance


def room_is_wall(cells: Cells) -> Cells:
    drawn = cells.copy()
    drawn[: len(cells) // 2] = OCCUPIED
    return drawn


def wall_is_room(cells: Cells) -> Cells:
    drawn = np.full_like(cells, FREE)
    drawn[[0, -1]] = drawn[:, [0, -1]] = OCCUPIED
    return drawn


WRONG: dict[str, Callable[[Cells], Cells]] = {
    "rooms that are not there": wall_is_room,
    "walls where rooms are": room_is_wall,
    "mirrored": lambda cells: np.ascontiguousarray(cells[:, ::-1]),
    "shifted": lambda cells: np.roll(cells, (4, -7), (0, 1)),
    "nothing": lambda cells: np.full_like(cells, UNKNOWN),
    "noise": lambda cells: np.random.default_rng(5).choice(np.array([-1, 0, 0, 100], np.int8), cells.shape),
}


@pytest.mark.parametrize("sensor", ["stage", "indoor"])
@pytest.mark.parametrize("draw", WRONG)
def test_a_wrong_plan_does_not_trap_the_robot(draw: str, sensor: str) -> None:
    simulation = explore(offices(), "plan-tour", Drawn(WRONG[draw]), sensor)
    assert simulation.stop_reason == "coverage"
    assert simulation.distance < 3 * unforeseen("layout-tour", sensor).distance


def test_a_door_that_is_shut() -> None:
    """Behind it nothing is to be seen, but the plan says so: the robot looks, and goes on with the rest."""
    plan = offices()
    truth = np.where(plan.rasterize(0.1).occupied, OCCUPIED, FREE).astype(np.int8)
    shut = plan.with_doors_closed([0])
    simulation = explore(
        shut, "plan-tour", Drawn(lambda cells: truth if truth.shape == cells.shape else cells)
    )
    assert truth.shape == simulation.raster.shape
    assert (truth == FREE).sum() > simulation.raster.free.sum()
    assert simulation.stop_reason == "coverage"


def test_low_confidence_is_no_foresight_where_more_is_asked_for() -> None:
    doubtful = Drawn(lambda cells: cells, confidence=0.4)
    without = explore(offices(), "plan-tour", None)
    assert np.array_equal(explore(offices(), "plan-tour:sure=0.5", doubtful).track, without.track)
    assert np.array_equal(without.track, unforeseen("watchful-tour").track)
    assert not np.array_equal(explore(offices(), "plan-tour", doubtful).track, without.track)


def test_the_same_run_twice() -> None:
    agent, predictor = "plan-tour:predictor=oracle:horizon=1", "oracle:horizon=1"
    runs = [explore(offices(), agent, make_predictor(predictor)) for _ in range(2)]
    assert np.array_equal(runs[0].track, runs[1].track)


def test_views_that_follow_the_changes_are_those_made_anew() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="indoor"), OraclePredictor(horizon=1))
    floor, decision = ForeseenFloor(0.8), simulation.reset(seed=3)
    while not simulation.done:
        foresight = decision.foresight
        assert foresight is not None
        floor.update(decision, foresight)
        anew = floor_in_view(decision, foresight.completed(decision.grid.cells))
        visibility = Visibility(anew, SCAN_SPACING, SAMPLE, fixed=False)
        places = Places(anew, visibility, 0.8)
        spare = visibility.spare
        assert np.array_equal(floor.places.cells, places.cells)
        assert np.array_equal(floor.places.views[:, :spare], places.views[:, :spare])
        assert np.array_equal(floor.places.visibility.target, visibility.target)
        decision = simulation.step(0)


def test_open_frontiers_count_while_nothing_is_foreseen_behind_them() -> None:
    for horizon, leads_on in ((0, True), (np.inf, False)):
        predictor = OraclePredictor(horizon=horizon)
        simulation = Simulation(offices(), SimulationConfig(sensor="indoor"), predictor)
        decision, floor, some = simulation.reset(seed=3), ForeseenFloor(0.8), False
        while not simulation.done:
            foresight = decision.foresight
            assert foresight is not None
            floor.update(decision, foresight)
            shown = {floor.frontier_of(view) for view in floor.places.views} - {None}
            assert shown == set(floor.open.tolist())
            some |= len(floor.open) > 0
            decision = simulation.step(0)
        assert some == leads_on


class DrawnRooms(Drawn):
    """Tells the classes of the true rooms beside what it draws."""

    def reveal(self, truth: Truth) -> None:
        super().reveal(truth)
        self._oracle = OraclePredictor()
        self._oracle.reveal(truth)

    def predict(self, decision: Decision) -> Decision:
        return super().predict(self._oracle.predict(decision))


@pytest.mark.parametrize("confidence", [0.9, 1.0])
def test_a_room_that_a_doubtful_plan_draws_as_wall_is_looked_for(confidence: float) -> None:
    """Where classes say that a room begins, but not where they say that hardly anything is left."""
    plan = floorplan_from_ascii(FAR_ROOMS, resolution=1.0)
    predictor = DrawnRooms(room_is_wall, confidence)
    simulation, floor = Simulation(plan, SimulationConfig(sensor="stage"), predictor), ForeseenFloor(0.8)
    decision = simulation.reset(seed=3, start=Pose(17.0, 2.0))
    foresight, table = decision.foresight, decision.table
    assert foresight is not None
    assert not foresight.beside(decision.grid.cells, decision.clusters).floor.any()
    floor.update(decision, foresight)
    leads_on = np.flatnonzero(table.closed < 0)
    assert 0 < len(leads_on) < len(table.closed)
    assert floor.open.tolist() == (leads_on.tolist() if confidence < 1 else [])


def test_what_is_given_up_is_asked_for_no_longer() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="short"), OraclePredictor(horizon=np.inf))
    decision, floor = simulation.reset(seed=3), ForeseenFloor(0.8)
    foresight = decision.foresight
    assert foresight is not None
    floor.update(decision, foresight)
    before, view = size(floor.seen), max(floor.places.views, key=lambda view: size(view & ~floor.seen))
    assert size(view & ~floor.seen) > 0
    floor.give_up(view)
    assert size(view & ~floor.seen) == 0
    assert size(floor.seen) > before
    floor.update(decision, foresight)
    assert size(view & ~floor.seen) == 0


@pytest.mark.parametrize(
    ("confidence", "used", "unused"), [(1.0, "early_sure", "early"), (0.9, "early", "early_sure")]
)
def test_certain_foresight_has_a_weight_of_its_own(confidence: float, used: str, unused: str) -> None:
    def run(agent: str) -> Simulation:
        return explore(offices(), agent, Drawn(lambda cells: cells, confidence))

    track = run("plan-tour").track
    assert np.array_equal(track, run(f"plan-tour:{unused}=50").track)
    assert not np.array_equal(track, run(f"plan-tour:{used}=50").track)


def test_the_robot_walks_no_farther_than_it_has_to_see() -> None:
    """Each walk is for foreseen cells that nobody has seen, and ends soon after next to none is left."""
    simulation = Simulation(offices(), SimulationConfig(sensor="indoor"), OraclePredictor(horizon=np.inf))
    agent, shortened = make_agent("plan-tour"), 0
    decision = simulation.reset(seed=3)
    agent.reset(3)
    while not simulation.done:
        choice = agent.act(decision)
        if isinstance(choice, Walk):
            assert (decision.grid.cells[choice.sights[:, 0], choice.sights[:, 1]] == UNKNOWN).all()
        decision = simulation.step(choice)
        if isinstance(choice, Walk) and not simulation.done:
            end = decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
            if end != tuple(choice.path[-1]):
                left = remaining_share(decision.grid.cells, choice.sights)
                assert left < simulation.config.gone_share
                shortened += 1
    assert shortened > 0


class Hall:
    """Foresees floor wherever nothing is known, on any map."""

    name = "hall"

    def predict(self, decision: Decision) -> Decision:
        """The decision with foresight."""
        foresight = Foresight(
            cells=np.zeros(decision.grid.shape, np.int8),
            room_ids=np.zeros(decision.grid.shape, np.int32),
            confidence=0.9,
            predictor=self.name,
            resolution=decision.grid.resolution,
        )
        return dataclasses.replace(decision, foresee=lambda: foresight)


def test_on_a_map_with_another_frame_it_begins_anew() -> None:
    """The map of a robot of one's own grows: cells that were remembered are other ones now."""
    agent, fresh, robot_map = make_agent("plan-tour"), make_agent("plan-tour"), RobotMap(Hall())
    agent.reset(0)
    fresh.reset(0)
    cells, here = np.full((60, 80), UNKNOWN, np.int8), Pose(2.0, 2.0)
    cells[5:55, 5:40] = FREE
    agent.act(robot_map.decide(OccupancyGrid(cells, 0.1), here))
    wider = np.pad(cells, ((0, 200), (30, 0)), constant_values=UNKNOWN)
    decision = robot_map.decide(OccupancyGrid(wider, 0.1, Pose(-3.0, 0.0)), here)
    choice, expected = agent.act(decision), fresh.act(decision)
    np.testing.assert_array_equal(robot_map.way(decision, choice), robot_map.way(decision, expected))
