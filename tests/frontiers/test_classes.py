"""Closed and open frontiers: the definition on drawings, the kernels against a slow version."""

from __future__ import annotations

import subprocess
import sys
from collections import deque

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.frontiers.classes import classify_frontiers
from layoutexplore.frontiers.detection import FrontierClusters, find_frontiers
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import FALSE_CLOSED_AREA, OraclePredictor, make_predictor
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.plans import TWO_HALLS

SIZES = st.shared(st.tuples(st.integers(3, 14), st.integers(3, 14)))


@settings(max_examples=80, deadline=None)
@given(
    cells=hnp.arrays(np.int8, SIZES, elements=st.sampled_from([-1, -1, 0, 0, 100])),
    rooms=hnp.arrays(np.int32, SIZES, elements=st.integers(0, 3)),
)
def test_against_a_slow_version(cells: NDArray[np.int8], rooms: NDArray[np.int32]) -> None:
    passable = cells != 100
    clusters = find_frontiers(cells)
    frontiers = [clusters.cluster(k) for k in range(len(clusters))]
    classes = classify_frontiers(cells, clusters, rooms, passable, 0.5)
    for k, frontier in enumerate(frontiers):
        steps = spread(cells, passable, frontier)
        near = [rooms[cell] for cell, depth in steps.items() if depth <= 1 and rooms[cell] > 0]
        room = max(set(near), key=lambda r: (near.count(r), -r)) if near else 0
        inside = passable & (rooms == room)
        share = (inside & (cells != -1)).sum() / inside.sum() if room else 1.0
        others = [sum(rooms[cell] == r for cell in steps) for r in (1, 2, 3) if r != room]
        assert classes.room[k] == room
        assert classes.is_closed[k] == (share >= 0.1 and max(others) * 0.25 < 1.0)
        assert classes.remaining_area[k] == 0.25 * ((inside & (cells == -1)).sum() if room else len(steps))


MANY = """
import numpy as np
from layoutexplore.frontiers.classes import classify_frontiers
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.processes import peak_memory

def classify(rooms):
    cells, ids = np.zeros((400, 400), np.int8), np.ones((400, 400), np.int32)
    cells[::2, ::2] = -1
    ids[1, 1] = rooms
    clusters = FrontierClusters.of([np.array([[0, 1]], np.int32)])
    return classify_frontiers(cells, clusters, ids, cells != 100, 1.0).remaining_area.tolist()

assert classify(1) == [40_000.0]
before = peak_memory()
assert classify(1_000) == [40_000.0]
print((peak_memory() - before) / 2**20)
"""


def test_many_specks_and_many_rooms_take_little_memory() -> None:
    """40,000 specks of unknown and 1,000 rooms: a table of all by all had 320 MB."""
    told = subprocess.run([sys.executable, "-c", MANY], capture_output=True, text=True, check=True)
    assert float(told.stdout) < 100.0


def spread(
    cells: NDArray[np.int8], passable: NDArray[np.bool_], frontier: NDArray[np.int32]
) -> dict[tuple[int, int], int]:
    """The unknown passable cells behind a frontier, with their distance in steps."""
    queue = deque((int(r), int(c), 0) for r, c in frontier)
    steps: dict[tuple[int, int], int] = {}
    while queue:
        r, c, depth = queue.popleft()
        for cell in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)):
            inside = 0 <= cell[0] < cells.shape[0] and 0 <= cell[1] < cells.shape[1]
            if inside and cells[cell] == -1 and passable[cell] and cell not in steps:
                steps[cell] = depth + 1
                queue.append((*cell, depth + 1))
    return steps


def test_no_frontier() -> None:
    cells = np.zeros((3, 3), np.int8)
    none = FrontierClusters.of([])
    classes = classify_frontiers(cells, none, np.ones((3, 3), np.int32), cells == 0, 0.1)
    assert len(classes.is_closed) == len(classes.room) == 0


def test_oracle_fills_in_every_frontier_and_flips_rooms_when_told() -> None:
    plan = floorplan_from_ascii(TWO_HALLS, resolution=0.5)
    config = SimulationConfig(sensor="short")
    truthful = Simulation(plan, config, OraclePredictor()).reset(seed=1)
    wrong = Simulation(plan, config, OraclePredictor(flip=1.0)).reset(seed=1)
    assert any(frontier.room for frontier in truthful.frontiers)
    for right, flipped in zip(truthful.frontiers, wrong.frontiers, strict=True):
        assert right.room == flipped.room and right.room in (0, 1, 2)
        if right.room == 0:
            assert flipped.is_closed is right.is_closed, "no room, hence none that is taken for another"
            continue
        assert right.is_closed is (not flipped.is_closed)
        assert flipped.expected_area == (FALSE_CLOSED_AREA if flipped.is_closed else right.expected_area)


def test_predictors_by_name() -> None:
    predictor = make_predictor("oracle:flip=0.1")
    assert predictor is not None and predictor.name == "oracle:flip=0.1"
    assert make_predictor("none") is None
