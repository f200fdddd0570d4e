"""Vector environments: the trajectories of single ones, Gymnasium's contract, workers that end cleanly."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import signal
import tempfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.errors import ConfigError, StartError, UnknownNameError, WorkerError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Ints
from layoutexplore.predictors import PREDICTORS, make_predictor, register_predictor
from tests.envs.cases import CASES, FRONTIER, IDS, MOTION, make, rooms
from tests.programs import said_by, wherever_it_comes_from

SMALL = ObservationConfig(local_size=16, global_size=16, detour=True, privileged=True)
SERIAL, THREADS, PROCESSES = ({"backend": name, "workers": 2} for name in ("serial", "threads", "processes"))
SAME_STEP, NEXT_STEP = AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP
TRAJECTORIES = [
    (*case, mode, backend)
    for case in CASES
    for mode in (SAME_STEP, NEXT_STEP)
    for backend in (SERIAL, THREADS)
]
TRAJECTORIES += [
    (*CASES[0], SAME_STEP, PROCESSES),
    (*CASES[-1], NEXT_STEP, PROCESSES),
]  # starting processes takes long


def options_of(name: str, **options: Any) -> dict[str, Any]:
    extra = {"observation": SMALL} if name == FRONTIER else {}
    return {"plan": rooms(), "sensor": "short"} | extra | options


def vector(name: str, count: int = 3, **options: Any) -> Any:
    return gymnasium.make_vec(name, num_envs=count, **options_of(name, **options))


def actions(
    space: gymnasium.Space[Any], observations: dict[str, np.ndarray], rng: np.random.Generator
) -> np.ndarray:
    """Valid ones, mostly the nearest frontier, so that episodes end soon."""
    if "action_mask" not in observations:
        return np.array([space.sample() for _ in range(len(observations["robot"]))])
    valid = [np.flatnonzero(mask[:-1]) for mask in observations["action_mask"]]
    return np.array([v[min(rng.integers(3), len(v) - 1)] if len(v) else 64 for v in valid])


def assert_same(ours: Any, theirs: Any) -> None:
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys()
        for key in theirs:
            assert_same(ours[key], theirs[key])
    elif isinstance(theirs, tuple) or (isinstance(theirs, np.ndarray) and theirs.dtype == object):
        for a, b in zip(ours, theirs, strict=True):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(ours, theirs)
        assert np.asarray(ours).dtype == np.asarray(theirs).dtype


@pytest.mark.parametrize(("name", "options", "mode", "backend"), TRAJECTORIES)
def test_trajectories_are_those_of_single_environments(
    name: str, options: dict[str, Any], mode: AutoresetMode, backend: dict[str, Any]
) -> None:
    """The reference is Gymnasium's own vector of single environments: observations, rewards, ends, infos."""
    limit = 5
    env = vector(name, autoreset_mode=mode, max_episode_steps=limit, **backend, **options)
    reference = SyncVectorEnv(
        [lambda: gymnasium.make(name, max_episode_steps=limit, **options_of(name), **options)] * 3,
        autoreset_mode=mode,
    )
    rng, ended = np.random.default_rng(0), 0
    try:
        assert env.metadata["autoreset_mode"] is mode
        assert env.observation_space == reference.observation_space
        assert env.action_space == reference.action_space
        assert env.single_observation_space == reference.single_observation_space
        env.single_action_space.seed(0)
        ours, theirs = env.reset(seed=[7, 11, 4]), reference.reset(seed=[7, 11, 4])
        assert_same(ours, theirs)
        for _ in range(14):
            chosen = actions(env.single_action_space, ours[0], rng)
            ours, theirs = env.step(chosen), reference.step(chosen)
            for mine, other in zip(ours, theirs, strict=True):
                assert_same(mine, other)
            assert env.observation_space.contains(ours[0])
            ended += int((ours[2] | ours[3]).sum())
        assert ended >= 3
        assert_same(env.reset(seed=5), reference.reset(seed=5))
        assert_same(env.reset(), reference.reset())
    finally:
        env.close()
        reference.close()


@pytest.mark.parametrize("name", IDS)
def test_the_default_resets_in_the_same_step(name: str) -> None:
    env = vector(name, backend="serial")
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert env.spec is not None and env.spec.id == name and env.num_envs == 3
    env.close()


def test_only_the_chosen_environments_are_reset() -> None:
    env = vector(FRONTIER, autoreset_mode="Disabled", backend="serial", max_episode_steps=2)
    first, _ = env.reset(seed=1)
    env.step(np.zeros(3, np.int64))
    *_, truncated, _ = env.step(np.zeros(3, np.int64))
    assert truncated.all()
    with pytest.raises(ResetNeeded, match="reset_mask"):
        env.step(np.zeros(3, np.int64))
    mask = np.array([False, True, False])
    again, infos = env.reset(seed=[None, 2, None], options={"reset_mask": mask})
    assert infos["_coverage"].tolist() == mask.tolist() and infos["scans"][1] == 1 and infos["scans"][0] == 0
    np.testing.assert_array_equal(again["robot"][1], first["robot"][1])
    assert not np.array_equal(again["robot"][0], first["robot"][0])
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(3, np.int64))
    env.close()


@pytest.mark.parametrize("backend", [SERIAL, THREADS, PROCESSES], ids=lambda backend: backend["backend"])
def test_attributes_calls_and_errors_pass_between_the_vector_and_its_environments(
    backend: dict[str, Any],
) -> None:
    env = vector(FRONTIER, **backend, render_mode="rgb_array", render_size=(320, 240))
    try:
        observations, _ = env.reset(seed=3)
        masks = np.array(env.call("action_masks"))
        np.testing.assert_array_equal(masks, observations["action_mask"] == 1)
        np.testing.assert_array_equal(masks, env.action_masks())
        assert env.get_attr("stop_reason") == ("", "", "")
        env.set_attr("mark", [1, 2, 3])
        assert env.get_attr("mark") == (1, 2, 3)
        env.set_attr("mark", 9)
        assert env.get_attr("mark") == (9, 9, 9)
        assert env.np_random_seed == (3, 4, 5)
        assert [frame.shape for frame in env.render()] == [(240, 320, 3)] * 3
        with pytest.raises(ConfigError, match="values"):
            env.set_attr("mark", [1, 2])
        with pytest.raises(AttributeError):
            env.get_attr("nothing_of_that_name")
        with pytest.raises(StartError, match="wall"):
            env.reset(options={"start": (0.25, 0.25)})
        env.reset(seed=0)
        with pytest.raises(ConfigError, match="outside of Discrete"):
            env.step(np.array([0, 99, 0]))
        with pytest.raises(ConfigError, match="shape"):
            env.step(np.zeros(2, np.int64))
        env.reset(seed=3)
    finally:
        env.close()


def test_a_predictor_is_not_shared() -> None:
    """The oracle is told the floor plan of its own environment alone."""
    plan = [rooms(), "apartment-01"]
    env = vector(FRONTIER, 4, backend="serial", plan=plan, predictor=make_predictor("oracle"))
    singles = [
        make(FRONTIER, plan=plan, sensor="short", observation=SMALL, predictor="oracle") for _ in range(4)
    ]
    observations, infos = env.reset(seed=0)
    assert len(set(infos["plan_index"])) == 2
    for _ in range(3):
        env.step(np.zeros(4, np.int64))
    observations, *_ = env.step(np.zeros(4, np.int64))
    for k, single in enumerate(singles):
        single.reset(seed=k)
        for _ in range(4):
            observation, *_ = single.step(0)
        np.testing.assert_array_equal(observations["frontiers"][k], observation["frontiers"])
    env.close()


@pytest.mark.parametrize("backend", [SERIAL, THREADS, PROCESSES], ids=lambda backend: backend["backend"])
def test_groups_need_not_wait_for_each_other(backend: dict[str, Any]) -> None:
    """Group by group, one of them ahead of the others, the environments go where they go together."""
    env, together = vector(FRONTIER, **backend), vector(FRONTIER, backend="serial")
    try:
        env.reset(seed=0)
        together.reset(seed=0)
        expected = [together.step(np.zeros(3, np.int64)) for _ in range(4)]
        taken = [0] * len(env.groups)
        for ahead in [*range(len(taken)), *[0] * 3, *[k for k in range(1, len(taken)) for _ in range(3)]]:
            env.send(np.zeros(env.groups[ahead][1] - env.groups[ahead][0], np.int64), ahead)
            group, (observations, rewards, terminated, truncated, infos) = env.receive()
            assert group == ahead
            rows, step = slice(*env.groups[group]), expected[taken[group]]
            assert_same(observations, {key: array[rows] for key, array in step[0].items()})
            for mine, theirs in zip((rewards, terminated, truncated), step[1:4], strict=True):
                np.testing.assert_array_equal(mine, theirs[rows])
            np.testing.assert_array_equal(infos["coverage"], step[4]["coverage"][rows])
            taken[group] += 1
        assert taken == [4] * len(taken)
    finally:
        env.close()
        together.close()


def test_results_are_copies_unless_told_otherwise() -> None:
    copied, bare = vector(FRONTIER, backend="serial"), vector(FRONTIER, backend="serial", copy=False)
    for env, same in ((copied, False), (bare, True)):
        first, _ = env.reset(seed=0)
        second, *_ = env.step(np.zeros(3, np.int64))
        assert (first["robot"] is second["robot"]) == same
        env.close()


def test_gymnasiums_statistics_work() -> None:
    env = RecordEpisodeStatistics(vector(MOTION, backend="serial", max_episode_steps=3))
    env.reset(seed=0)
    for _ in range(3):
        *_, infos = env.step(np.zeros(3, np.int64))
    assert infos["episode"]["l"].tolist() == [3, 3, 3]
    env.close()


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"backend": "thread"}, UnknownNameError, "threads"),
        ({"autoreset_mode": "SameSteps"}, UnknownNameError, "SameStep"),
        ({"count": 0}, ConfigError, "num_envs"),
        ({"workers": 0}, ConfigError, "workers"),
        ({"max_episode_steps": 0}, ConfigError, "max_episode_steps"),
        ({"plan": []}, ConfigError, "floor plan"),
    ],
)
def test_options_are_checked(options: dict[str, Any], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        vector(FRONTIER, **options)


def children() -> set[Any]:
    return {child.pid for child in multiprocessing.active_children()}


def test_closing_leaves_no_process_and_no_shared_memory() -> None:
    before = children()
    env = vector(MOTION, backend="processes", workers=2)
    assert len(children() - before) == 2
    env.reset(seed=0)
    env.step_async(np.zeros(3, np.int64))
    env.close()
    env.close()
    assert children() == before
    shared = f"pym-{os.getpid()}-"  # what multiprocessing calls the files behind shared memory
    assert not [
        path for folder in ("/dev/shm", tempfile.gettempdir()) for path in Path(folder).glob(f"{shared}*")
    ]


def test_the_death_of_a_worker_is_told() -> None:
    before = children()
    env = vector(FRONTIER, backend="processes", workers=2)
    env.reset(seed=0)
    os.kill(max(children() - before), signal.SIGKILL)
    with pytest.raises(WorkerError, match=r"worker \d of 2 \(environments \d to \d\) was killed by SIGKILL"):
        for _ in range(2):
            env.step(np.zeros(3, np.int64))
    assert children() == before
    with pytest.raises(ClosedEnvironmentError, match="make a new one"):
        env.step(np.zeros(3, np.int64))
    env.close()


def test_a_worker_that_cannot_start_says_why() -> None:
    before = children()
    with pytest.raises(StartError, match="on purpose"):
        vector(FRONTIER, backend="processes", workers=1, reward=_Broken())
    assert children() == before


def _explode() -> None:
    raise StartError("on purpose")


class _Broken:
    """A reward that cannot be unpacked in another process."""

    def __call__(self, transition: Any) -> float:
        return 0.0

    def __reduce__(self) -> Any:
        return (_explode, ())


UNGUARDED = """
import gymnasium, layoutexplore, numpy as np
from layoutexplore.maps.tracing import floorplan_from_ascii
plan = floorplan_from_ascii("#####\\n#...#\\n#...#\\n#####", resolution=1.0)
def mine(transition): return 7.0
env = gymnasium.make_vec("LayoutExplore/Motion-v0", num_envs=2, backend="processes", workers=2,
                         plan=lambda rng: plan, reward=mine)
env.reset(seed=0)
print(env.step(np.zeros(2, int))[1].tolist())
"""


@wherever_it_comes_from
def test_a_program_needs_neither_a_file_nor_a_guard(from_stdin: bool, tmp_path: Path) -> None:
    assert said_by(UNGUARDED, tmp_path, from_stdin=from_stdin) == "[7.0, 7.0]\n"


@pytest.mark.parametrize("backend", [SERIAL, THREADS, PROCESSES], ids=lambda options: options["backend"])
def test_nothing_goes_on_in_closed_environments(backend: dict[str, Any]) -> None:
    env = vector(FRONTIER, 2, **backend).unwrapped
    env.reset(seed=0)
    env.close()
    env.close()  # Gymnasium's environments may be closed twice
    calls = {
        "reset": (),
        "step": (np.zeros(2, int),),
        "step_wait": (),
        "send": (np.zeros(1, int), 0),
        "receive": (),
        "action_masks": (),
        "call": ("spec",),
        "get_attr": ("spec",),
        "set_attr": ("mark", 1),
        "render": (),
    }
    for name, arguments in calls.items():
        with pytest.raises(ClosedEnvironmentError, match="FrontierVectorEnv of 2 environments is closed"):
            getattr(env, name)(*arguments)


def test_single_environments_can_still_be_vectorised_by_gymnasium() -> None:
    env = gymnasium.make_vec(MOTION, num_envs=2, vectorization_mode="sync", **options_of(MOTION))
    assert isinstance(env, SyncVectorEnv)
    env.close()


def test_the_information_is_as_declared() -> None:
    for name in IDS:
        env = make(name).unwrapped
        _, info = env.reset(seed=0)
        assert {key: np.asarray(value).dtype for key, value in info.items()} == {
            key: zero.dtype for key, zero in env.info_types.items()
        }
        assert all(np.shape(info[key]) == zero.shape for key, zero in env.info_types.items())
        pickle.dumps(copy.deepcopy(env.info_types))


def test_the_autoreset_mode_stands_where_gymnasium_s_own_have_it() -> None:
    for mode in AutoresetMode:
        theirs = SyncVectorEnv([lambda: make(FRONTIER, plan=rooms())], autoreset_mode=mode)
        envs = gymnasium.make_vec(FRONTIER, 1, plan=rooms(), autoreset_mode=mode)
        for found in (envs, theirs):
            assert found.metadata["autoreset_mode"] is mode
            assert found.unwrapped.autoreset_mode is mode  # type: ignore[attr-defined]
            found.close()


@pytest.mark.parametrize("predictor", ["all-one-room", "file"])
def test_workers_know_predictors_of_one_s_own(predictor: str, tmp_path: Path) -> None:
    """Registered in this process, or in a file: the frontiers' classes are the same in workers and here."""

    class AllOneRoom:
        """Whatever is free is one room."""

        def rooms(self, decision: Decision) -> Ints:
            return (decision.grid.cells == 0).astype(np.int64)

    if predictor == "file":
        text = "class Mine:\n    def rooms(self, decision):\n        return (decision.grid.cells == 0) * 1\n"
        (tmp_path / "mine.py").write_text(text)
        predictor = f"{tmp_path / 'mine.py'}:Mine"
    else:
        register_predictor(predictor, "whatever is free is one room", AllOneRoom)
    seen = []
    try:
        for backend in ("serial", "processes"):
            options: dict[str, Any] = {"backend": backend, "workers": 2, "predictor": predictor}
            envs = gymnasium.make_vec("LayoutExplore/Frontier-v0", 2, plan="apartment-03", **options)
            seen.append(envs.reset(seed=3)[0])
            envs.close()
    finally:
        PREDICTORS.remove(predictor)
    assert all(np.array_equal(seen[0][key], seen[1][key]) for key in seen[0])
