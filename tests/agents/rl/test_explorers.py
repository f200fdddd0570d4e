"""Jobs side by side in worker processes."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

from layoutexplore.agents import make_agent
from layoutexplore.agents.rl.evaluation import Evaluation
from layoutexplore.agents.rl.explorers import explore_all
from layoutexplore.errors import WorkerError
from tests.agents.rl.cases import small_config
from tests.agents.rl.jobs import die, fail, wait_for_stop, where

SHORT, LONG = 0.01, 60.0


def nobody_asks() -> bool:
    return False


def test_results_come_in_the_order_of_the_jobs() -> None:
    jobs = [10 * SHORT, SHORT, 5 * SHORT, 2 * SHORT]
    found = explore_all(where, jobs, nobody_asks, 2)
    assert [seconds for seconds, _ in found] == jobs
    assert os.getpid() not in {process for _, process in found}
    alone = explore_all(where, jobs, nobody_asks, 1)
    assert {process for _, process in alone} == {os.getpid()}


def test_it_stops_within_a_job() -> None:
    began = time.monotonic()
    asked: list[bool] = []

    def stop() -> bool:
        asked.append(True)
        return len(asked) > 2

    assert len(explore_all(wait_for_stop, [LONG] * 4, stop, 2)) < 4
    assert time.monotonic() - began < LONG


def test_jobs_that_wait_in_the_workers_are_not_done_when_nobody_wants_them() -> None:
    """By then all have left this process: two are being done, and two are queued."""

    def stop() -> bool:
        time.sleep(2.0)
        return True

    assert len(explore_all(wait_for_stop, [LONG] * 4, stop, 2)) <= 2


def test_an_interruption_does_not_wait_for_jobs() -> None:
    began = time.monotonic()
    asked: list[bool] = []

    def stop() -> bool:
        asked.append(True)
        if len(asked) > 2:
            raise KeyboardInterrupt
        return False

    with pytest.raises(KeyboardInterrupt):
        explore_all(wait_for_stop, [LONG] * 4, stop, 2)
    assert time.monotonic() - began < LONG


@pytest.mark.parametrize("jobs", [["this one", ""], ["", "this one"], ["this one", "this one"]])
def test_a_failure_is_told_as_it_was(jobs: list[str]) -> None:
    with pytest.raises(ValueError, match=r"^this one$"):
        explore_all(fail, jobs, nobody_asks, 2)


def test_a_worker_that_dies_is_told() -> None:
    with pytest.raises(WorkerError, match="out of memory"):
        explore_all(die, [3, 3], nobody_asks, 2)


def test_an_evaluation_is_the_same_whoever_explores(tmp_path: Path) -> None:
    evaluation = {"starts": 2, "references": ["random"]}
    alone, beside = (
        Evaluation(small_config(tmp_path, workers=workers, evaluation=evaluation)) for workers in (1, 2)
    )
    agent = make_agent("nearest")
    assert beside.compare(agent) == alone.compare(agent)
