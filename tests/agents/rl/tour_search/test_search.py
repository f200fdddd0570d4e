"""The search for a tour's parameters: its draws, what it learns from, and that resuming changes nothing."""

from __future__ import annotations

import dataclasses
import os
import shutil
import signal
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.card import read_card  # noqa: E402
from layoutexplore.agents.rl.hyperparameters import TrainingConfig, read_config  # noqa: E402
from layoutexplore.agents.rl.run import EVALUATIONS  # noqa: E402
from layoutexplore.agents.rl.torch_policy_files import load_actor  # noqa: E402
from layoutexplore.agents.rl.tour_search.search import (  # noqa: E402
    EXPLORATIONS,
    LINEAR,
    PARAMETERS,
    Exploration,
    SearchRun,
    explore_group,
    read_explorations,
)
from layoutexplore.errors import ConfigError, LayoutExploreError, ResultsError, WorkerError  # noqa: E402
from layoutexplore.files import to_toml  # noqa: E402
from layoutexplore.frontiers.tour_features import TourConfig  # noqa: E402
from layoutexplore.metrics.exploration import score_curve  # noqa: E402
from layoutexplore.plugins.transport import worker_killed  # noqa: E402
from layoutexplore.simulation.config import SimulationConfig  # noqa: E402
from layoutexplore.simulation.episode import play  # noqa: E402
from layoutexplore.simulation.simulation import Simulation  # noqa: E402
from tests.agents.rl.cases import SMALL_SEARCH, Silent, train  # noqa: E402


def small_config(tmp_path: Path, **changes: Any) -> TrainingConfig:
    path = tmp_path / "small.toml"
    path.write_text(to_toml({**SMALL_SEARCH, **changes}))
    return read_config(path)


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("searched")
    train(small_config(folder), folder / "run")
    return folder / "run"


def test_what_a_search_leaves(searched: Path) -> None:
    policies = {"best.safetensors", "best.toml", "policy.safetensors", "policy.toml"}
    assert {path.name for path in searched.iterdir()} == {
        "config.toml",
        EXPLORATIONS,
        "evaluations.csv",
        "tensorboard",
        *policies,
    }
    assert len(read_explorations(searched / EXPLORATIONS, 4)) == 12
    tour = read_card(searched / "policy.safetensors")["policy"]["tour"]
    assert tour != dataclasses.asdict(TourConfig()) and set(tour) == set(PARAMETERS)
    assert getattr(make_agent(f"policy:{searched}"), "predictor", "") == "none"


@pytest.mark.parametrize("kept", [0.4, 0.95])
def test_a_resumed_search_is_the_one_that_was_never_stopped(
    searched: Path, tmp_path: Path, kept: float
) -> None:
    """However much of the file of explorations a kill has left."""
    text = (searched / EXPLORATIONS).read_bytes()
    (tmp_path / EXPLORATIONS).write_bytes(text[: int(kept * len(text))])
    run = train(small_config(tmp_path), tmp_path, resume=True)
    assert (tmp_path / EXPLORATIONS).read_bytes() == text
    expected, found = (load_actor(folder / "policy.safetensors") for folder in (searched, tmp_path))
    assert expected[1] == found[1] and run.tour == found[1].tour
    assert all(
        torch.equal(found[0].state_dict()[name], tensor) for name, tensor in expected[0].state_dict().items()
    )


def test_a_resumed_search_has_taken_the_time_before_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(SearchRun, "seconds", property(lambda run: 5400.0))
        train(small_config(tmp_path, steps=4), tmp_path / "run")
    run = train(small_config(tmp_path, steps=8), tmp_path / "run", resume=True)
    assert 5400.0 < run.seconds < 7200.0
    assert read_card(tmp_path / "run" / "policy.safetensors")["training"]["minutes"] >= 90.0


@pytest.mark.parametrize("asked", [True, False])
def test_workers_that_are_asked_to_end_with_their_run_are_no_error(tmp_path: Path, asked: bool) -> None:
    class Cluster(Silent):
        def advance(self, steps: int, total: int) -> None:
            if asked:
                os.kill(os.getpid(), signal.SIGTERM)
            raise worker_killed(2)

    with nullcontext() if asked else pytest.raises(WorkerError, match="was killed"):
        run = train(small_config(tmp_path), tmp_path / "run", watcher=Cluster())
        assert run.stopping and run.steps == 4
    assert len(read_explorations(tmp_path / "run" / EXPLORATIONS, 4)) == 4


def test_ctrl_c_leaves_whole_groups(tmp_path: Path) -> None:
    class Impatient(Silent):
        def advance(self, steps: int, total: int) -> None:
            super().advance(steps, total)
            os.kill(os.getpid(), signal.SIGINT)

    run = train(small_config(tmp_path), tmp_path / "run", watcher=Impatient())
    assert run.stopping and run.steps == 4
    assert len(read_explorations(tmp_path / "run" / EXPLORATIONS, 4)) == 4
    assert getattr(make_agent(f"policy:{tmp_path / 'run'}"), "predictor", "") == "none"


@pytest.mark.parametrize(("marks", "left"), [([0, 8], [0]), ([0, 8, 12], [0, 8]), ([0, 8, 12], [0])])
def test_an_evaluation_that_was_cut_off_is_made_up_for(
    searched: Path, tmp_path: Path, marks: list[int], left: list[int]
) -> None:
    """Also the last one, behind which nothing is explored any more."""
    shutil.copytree(searched, tmp_path / "run")
    lines = (searched / EVALUATIONS).read_text().splitlines(keepends=True)
    (tmp_path / "run" / EVALUATIONS).write_text("".join(lines[: 1 + len(left)]))
    explored = (searched / EXPLORATIONS).read_text().splitlines(keepends=True)
    (tmp_path / "run" / EXPLORATIONS).write_text("".join(explored[: 1 + marks[-1]]))
    run = train(small_config(tmp_path, steps=marks[-1]), tmp_path / "run", resume=True)
    assert [evaluation["steps"] for evaluation in run.evaluations] == [*left, marks[-1]]
    assert (tmp_path / "run" / EVALUATIONS).read_text().splitlines()[-1] == lines[1 + marks.index(marks[-1])][
        :-1
    ]


def test_the_policy_goes_where_the_searched_tour_begins() -> None:
    """What the search explores is what the policy that it writes does."""
    config = read_config(
        None,
        {"algorithm": "tour-search", "predictor": "none", "sensors": ("indoor",), "plans": ("apartment-01",)},
    )
    tour = TourConfig(first_leg=0.5, hold=1.0, patience=2.0)
    [(d95, d99)] = explore_group(config, 5, [tour])
    from layoutexplore.agents.rl.agent import NetworkPolicy
    from layoutexplore.agents.rl.card import spec_of
    from layoutexplore.agents.rl.networks.actor_critic import Actor

    spec = spec_of(dataclasses.replace(config, tour=tour))
    rng = np.random.default_rng([config.seed, 0, 5])
    rng.integers(1), rng.integers(1)  # the plan, the sensor and three disturbances are drawn before the seed
    for _ in range(3):
        rng.integers(1)
    simulation = Simulation("apartment-01", SimulationConfig(sensor="indoor"))
    episode = play(
        simulation, NetworkPolicy("policy", Actor(spec).eval(), spec), seed=int(rng.integers(2**31))
    )
    scores = score_curve(episode.curve, budget=simulation.max_distance, target_area=simulation.target_area)
    assert (scores.d95, scores.d99) == pytest.approx((d95, d99))


def test_draws_are_mirrored_around_the_centre_and_depend_on_the_seed_alone(tmp_path: Path) -> None:
    run = SearchRun(small_config(tmp_path), tmp_path / "a", device="cpu", resume=False, watcher=Silent())
    draws = run.draws(0)
    assert draws.shape == (4, len(PARAMETERS))
    np.testing.assert_allclose(draws[:2], -draws[2:])
    again = SearchRun(small_config(tmp_path), tmp_path / "b", device="cpu", resume=False, watcher=Silent())
    np.testing.assert_array_equal(again.draws(1), run.draws(1))
    assert not np.array_equal(run.draws(0), run.draws(1))


def test_the_centre_moves_to_what_was_better(tmp_path: Path) -> None:
    """Explorations that were short where the first leg counted more: there the next ones are drawn."""
    run = SearchRun(
        small_config(tmp_path, steps=960, search={"round": 480}),
        tmp_path / "a",
        device="cpu",
        resume=False,
        watcher=Silent(),
    )
    parameter = PARAMETERS.index("first_leg")
    for group in range(120):
        for member, z in enumerate(run.draws(group)):
            metres = (50.0 + group) * float(np.exp(-0.05 * max(z[parameter], 0.0)))
            run.explorations.append(Exploration(group, member, metres, 2 * metres))
    tour, start = run.tour, TourConfig()
    assert tour.first_leg > 0.5 * run.search.trust * LINEAR["first_leg"]
    assert tour.first_leg <= run.search.trust * LINEAR["first_leg"] + 1e-12
    others = [name for name in PARAMETERS if name != "first_leg"]
    assert all(
        abs(getattr(tour, name) - getattr(start, name)) < 0.2 * max(getattr(start, name), 1.0)
        for name in others
    )


def test_explorations_of_something_else(searched: Path, tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="no checkpoint"):
        read_explorations(tmp_path / EXPLORATIONS, 4)
    (tmp_path / EXPLORATIONS).write_text("a,b\n1,2\n")
    with pytest.raises(ResultsError, match="not a file of explorations"):
        read_explorations(tmp_path / EXPLORATIONS, 4)
    (tmp_path / EXPLORATIONS).write_bytes(b"\xff\xfe\n")
    with pytest.raises(ResultsError, match="no text in UTF-8"):
        read_explorations(tmp_path / EXPLORATIONS, 4)
    (tmp_path / EXPLORATIONS).write_text("group,member,d95,d99\n0,0,x,3.0\n")
    with pytest.raises(ResultsError, match="damaged"):
        read_explorations(tmp_path / EXPLORATIONS, 4)
    with pytest.raises(ResultsError, match="does not fit"):
        read_explorations(searched / EXPLORATIONS, 6)
    with pytest.raises(ResultsError, match="add --resume"):
        SearchRun(small_config(tmp_path), searched, device="cpu", resume=False, watcher=Silent())
    shutil.copytree(searched, tmp_path / "run")
    for damage in (b"steps,score\n12,high\n", b"score\n1.0\n", b"\xff\xfe\n1\n"):
        (tmp_path / "run" / EVALUATIONS).write_bytes(damage)
        with pytest.raises(ResultsError, match=r"evaluations\.csv is damaged"):
            SearchRun(small_config(tmp_path), tmp_path / "run", device="cpu", resume=True, watcher=Silent())


@pytest.mark.parametrize(
    "changes",
    [
        {"generator": {"area": [10.0, 20.0]}},
        {"sensors": ["none-such"]},
        {"predictor": "lay"},
        {"plans": ["officee:1"]},
    ],
)
def test_what_cannot_be_explored_is_told_before_anything_is_written(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    with pytest.raises(LayoutExploreError):
        SearchRun(
            small_config(tmp_path, **changes), tmp_path / "run", device="cpu", resume=False, watcher=Silent()
        )
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"round": 6}, "multiple of twice"),
        ({"spread": 0.0}, "spread must be a finite number above 0"),
        ({"pairs": 0}, "pairs must be a whole"),
    ],
)
def test_searches_that_make_no_sense(tmp_path: Path, table: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        small_config(tmp_path, search={**SMALL_SEARCH["search"], **table})
