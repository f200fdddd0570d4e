"""Training runs: resumed is the same as never stopped, interrupted is usable, and learning learns."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

import safetensors.torch  # noqa: E402

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl import environments  # noqa: E402
from layoutexplore.agents.rl.checkpoint import FILE  # noqa: E402
from layoutexplore.agents.rl.environments import environment_arguments  # noqa: E402
from layoutexplore.agents.rl.hyperparameters import TrainingConfig, read_config  # noqa: E402
from layoutexplore.agents.rl.ppo.algorithm import FrontierPPO  # noqa: E402
from layoutexplore.agents.rl.ppo.collector import Ends  # noqa: E402
from layoutexplore.agents.rl.training import Run  # noqa: E402
from layoutexplore.agents.rl.vector import VectorAdapter  # noqa: E402
from layoutexplore.errors import ConfigError, LayoutExploreError, ResultsError  # noqa: E402
from layoutexplore.simulation.config import SimulationConfig  # noqa: E402
from tests.agents.rl.cases import Silent, small_config, train, write_config  # noqa: E402


def tensors(folder: Path) -> dict[str, Any]:
    return dict(safetensors.torch.load_file(folder / FILE))


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trained")
    train(small_config(folder), folder / "run")
    return folder / "run"


def test_what_a_run_leaves(trained: Path) -> None:
    names = {path.name for path in trained.iterdir()}
    policies = {"best.safetensors", "best.toml", "policy.safetensors", "policy.toml"}
    assert names == {"config.toml", FILE, "evaluations.csv", "tensorboard"} | policies
    rows = list(csv.DictReader((trained / "evaluations.csv").open()))
    assert [int(row["steps"]) for row in rows] == [0, 32, 64]
    assert all(0.2 < float(row["d95_ratio.nearest"]) < 5 for row in rows)
    assert make_agent(f"policy:{trained}").predictor == "none"


def test_a_resumed_run_is_the_one_that_was_never_stopped(trained: Path, tmp_path: Path) -> None:
    config = small_config(tmp_path)
    train(dataclasses.replace(config, steps=32), tmp_path / "run")
    run = train(config, tmp_path / "run", resume=True)
    assert run.progress.steps == 64
    expected, found = tensors(trained), tensors(tmp_path / "run")
    assert expected.keys() == found.keys()
    assert all(torch.equal(expected[name], found[name]) for name in expected)
    assert [e["steps"] for e in run.progress.evaluations] == [0, 32, 64]


def test_a_checkpoint_from_before_the_imitation_was_noted(trained: Path, tmp_path: Path) -> None:
    progress = {"algorithm": "FrontierPPO", "steps": 64, "updates": 4, "calls": 0, "format": 1}
    metadata = {"progress": json.dumps(progress)}
    safetensors.torch.save_file(tensors(trained), tmp_path / FILE, metadata=metadata)
    config, watcher = small_config(tmp_path, imitation={"teacher": "nearest-0.4"}), Silent()
    run = train(config, tmp_path, resume=True, watcher=watcher)
    assert run.progress.steps == 64 and not any("imitation" in line for line in watcher.lines)


def test_a_run_starts_from_a_policy(trained: Path, tmp_path: Path) -> None:
    policy, usual = trained / "policy.safetensors", read_config(flags={"algorithm": "maskable-ppo"}).network
    changes = {"start_from": str(policy), "start_temperature": 5.0, "critic_steps": 16}
    config = dataclasses.replace(small_config(tmp_path, steps=16, **changes), network=usual)
    run = train(config, tmp_path / "run")  # only the critic learns: the actor stays as it begins
    assert run.config.network == read_config(trained / "config.toml").network != usual
    theirs, mine = (
        safetensors.torch.load_file(path) for path in (policy, tmp_path / "run" / "policy.safetensors")
    )
    for name, values in theirs.items():
        last = name.partition(".")[0] in ("score", "direct", "stop", "tour_weight")
        assert torch.allclose(values / 5.0 if last else values, mine[name])
    assert theirs["score.weight"].any()
    *_, learnt = csv.DictReader((trained / "evaluations.csv").open())
    assert run.evaluations[0]["score"] == float(learnt["score"])  # it chooses as that policy does


def test_a_run_that_started_from_a_policy_goes_on_without_it(trained: Path, tmp_path: Path) -> None:
    shutil.copytree(trained, tmp_path / "policy")
    config = small_config(tmp_path, steps=16, start_from=str(tmp_path / "policy"))
    train(config, tmp_path / "run")
    shutil.rmtree(tmp_path / "policy")
    kept = read_config(tmp_path / "run" / "config.toml", {"steps": 32})
    assert train(kept, tmp_path / "run", resume=True).progress.steps == 32


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"network": {"width": 16}}, r"\[network\] is that of the policy to start from, .*: leave it out"),
        ({"tour": {"patience": 2.0}}, r"\[tour\] is that of the policy to start from"),
        ({"observation": {"detour": False}}, "reads the frontier features .* observation.detour"),
        ({"start_from": "nowhere"}, "nowhere"),
        ({"start_temperature": 0.0}, "start_temperature must be a finite number above 0"),
    ],
)
def test_policies_that_do_not_fit_a_run(
    trained: Path, tmp_path: Path, changes: dict[str, Any], told: str
) -> None:
    with pytest.raises(ConfigError, match=told):
        train(small_config(tmp_path, **{"start_from": str(trained)} | changes), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_what_was_expected_counts_where_the_budget_cuts_an_episode_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def short(config: TrainingConfig) -> dict[str, Any]:
        return environment_arguments(config) | {"simulation": SimulationConfig(max_distance=25.0)}

    def judge(self: FrontierPPO, ends: Ends) -> None:
        rewards = self.rollout_buffer.rewards.copy()
        original(self, ends)
        for place, info in ends.items():
            assert info["TimeLimit.truncated"]
            final, _ = self.policy.obs_to_tensor(info["terminal_observation"])
            rewards[place] += self.gamma * self.policy.predict_values(final).item()
        assert rewards == pytest.approx(self.rollout_buffer.rewards)
        cut_off.extend(ends)

    cut_off: list[tuple[int, int]] = []
    original = FrontierPPO._judge
    monkeypatch.setattr(environments, "environment_arguments", short)
    monkeypatch.setattr(FrontierPPO, "_judge", judge)
    train(small_config(tmp_path), tmp_path / "run")
    assert cut_off


def test_training_moved_actor_and_critic(trained: Path, tmp_path: Path) -> None:
    train(small_config(tmp_path, steps=16, critic_steps=16), tmp_path / "run")
    start, end = tensors(tmp_path / "run"), tensors(trained)
    for part in ("policy.actor.", "policy.critic."):
        assert any(not torch.equal(start[name], end[name]) for name in end if name.startswith(part))


def test_the_learning_rate_hangs_on_the_steps_of_the_whole_run(tmp_path: Path) -> None:
    config = small_config(tmp_path, steps=32, final_learning_rate=1e-4, learning={"learning_rate": 3e-4})
    run = train(config, tmp_path / "run")
    assert run.model.policy.optimizer.param_groups[0]["lr"] == pytest.approx(1e-4)
    config = dataclasses.replace(config, steps=64)
    run = Run(config, tmp_path / "run", device="cpu", resume=True, watcher=Silent())
    assert run.model.lr_schedule(1.0) == pytest.approx(2e-4)
    run.envs.close()


def test_what_is_kept_is_the_average_of_the_actor(trained: Path) -> None:
    state, kept = tensors(trained), safetensors.torch.load_file(trained / "policy.safetensors")
    assert all(torch.equal(kept[name], state[f"policy.averaged.{name}"]) for name in kept)
    assert any(not torch.equal(kept[name], state[f"policy.actor.{name}"]) for name in kept)


def test_a_run_is_not_overwritten(trained: Path, tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="add --resume"):
        Run(small_config(tmp_path), trained, device="cpu", resume=False, watcher=Silent())


def test_small_networks_stay_on_the_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def note(device: str) -> str:
        asked.append(device)
        return "cpu"

    monkeypatch.setattr("layoutexplore.agents.rl.training.chosen_device", note)
    for device in ("auto", "cuda"):
        monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
        Run(small_config(tmp_path), tmp_path / device, device=device, resume=False, watcher=Silent())
    assert asked == ["cpu", "cuda"]


def test_nothing_to_resume(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="no checkpoint"):
        Run(small_config(tmp_path), tmp_path / "run", device="cpu", resume=True, watcher=Silent())


@pytest.mark.parametrize("kept", [50, -1])
def test_a_damaged_checkpoint(trained: Path, tmp_path: Path, kept: int) -> None:
    (tmp_path / FILE).write_bytes((trained / FILE).read_bytes()[:kept])
    with pytest.raises(ResultsError, match="damaged"):
        Run(small_config(tmp_path), tmp_path, device="cpu", resume=True, watcher=Silent())


def test_a_checkpoint_of_another_network(trained: Path, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes((trained / FILE).read_bytes())
    with pytest.raises(ResultsError, match="does not fit this run's network"):
        Run(
            small_config(tmp_path, network={"width": 16}),
            tmp_path,
            device="cpu",
            resume=True,
            watcher=Silent(),
        )


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_no_gpu(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no CUDA device"):
        Run(small_config(tmp_path), tmp_path / "run", device="cuda", resume=False, watcher=Silent())


def test_ctrl_c_leaves_a_checkpoint_to_go_on_from(tmp_path: Path) -> None:
    class Impatient(Silent):
        def advance(self, steps: int, total: int) -> None:
            super().advance(steps, total)
            if steps == 20:
                os.kill(os.getpid(), signal.SIGINT)

    handler = signal.getsignal(signal.SIGINT)
    config, watcher = small_config(tmp_path), Impatient()
    run = train(config, tmp_path / "run", watcher=watcher)
    assert signal.getsignal(signal.SIGINT) is handler
    assert run.stopping and run.progress.steps == 16 and any("stopping" in line for line in watcher.lines)
    assert make_agent(f"policy:{tmp_path / 'run'}").predictor == "none"
    assert train(config, tmp_path / "run", resume=True).progress.steps == 64


def test_the_first_actions_are_the_same(tmp_path: Path) -> None:
    def actions() -> list[list[int]]:
        run = Run(
            small_config(tmp_path),
            tmp_path / str(os.urandom(4).hex()),
            device="cpu",
            resume=False,
            watcher=Silent(),
        )
        run.model.set_random_seed(7)
        observation, taken = run.envs.reset(), []
        for _ in range(20):
            with torch.no_grad():
                batch = {name: torch.from_numpy(array) for name, array in observation.items()}
                chosen, _, _ = run.model.policy(batch, action_masks=run.envs.action_masks())
            taken.append(chosen.tolist())
            observation, _, _, _ = run.envs.step(chosen.numpy())
        run.envs.close()
        return taken

    assert actions() == actions()


@pytest.mark.parametrize("algorithm", ["ppo", "dqn"])
def test_motion(algorithm: str, tmp_path: Path) -> None:
    learning = {
        "ppo": {"n_steps": 8, "batch_size": 8},
        "dqn": {"learning_starts": 4, "buffer_size": 64, "batch_size": 4},
    }
    table = {
        "algorithm": algorithm,
        "envs": 2,
        "workers": 1,
        "steps": 32,
        "checkpoint_every": 16,
        "max_steps": 20,
        "plans": ["apartment-01"],
        "learning": learning[algorithm],
        "evaluation": {"plans": ["apartment-01"], "every": 32},
    }
    from layoutexplore.files import to_toml

    path = tmp_path / "motion.toml"
    path.write_text(to_toml(table))
    config = read_config(path)
    run = train(config, tmp_path / "run")
    assert run.progress.steps == 32 and 0 < run.progress.evaluations[-1]["coverage"] <= 1
    train(dataclasses.replace(config, steps=48), tmp_path / "run", resume=True)
    with pytest.raises(ResultsError, match="does not choose frontiers"):
        make_agent(f"policy:{tmp_path / 'run'}")


@pytest.mark.slow
def test_two_minutes_of_training_beat_random(tmp_path: Path) -> None:
    config = read_config(
        write_config(
            tmp_path / "config.toml",
            steps=6144,
            envs=8,
            plans=["apartment:1-40"],
            checkpoint_every=2048,
            critic_steps=0,
            network={"tour_weight": 0.0, "detour_weight": 0.0, "width": 32, "heads": 4},
            learning={"n_steps": 64, "batch_size": 128, "n_epochs": 6},
            evaluation={"every": 6144, "plans": ["apartment:41-44"], "starts": 2, "references": ["random"]},
        )
    )
    run = train(config, tmp_path / "run")
    first, last = run.progress.evaluations[0], run.progress.evaluations[-1]
    assert last["score"] < 0.9 and last["score"] < first["score"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"predictor": "nonsense"}, "unknown predictor 'nonsense'"),
        ({"evaluation": {"references": ["tuor"]}}, "unknown agent 'tuor': did you mean 'tour'"),
        ({"evaluation": {"plans": ["officee:3"]}}, "officee"),
        ({"evaluation": {"plans": ["/dev/null"]}}, "no known format"),
        ({"evaluation": {"plans": ["office:1-1000"], "starts": 1000}}, "explores 100000 times at most"),
        ({"imitation": {"teacher": "tuor"}}, "unknown agent 'tuor'"),
        ({"envs": 64, "learning": {"n_steps": 100_000}, "observation": {"max_frontiers": 10_000}}, "memory"),
    ],
)
def test_what_cannot_be_trained_is_told_before_anything_is_written(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(LayoutExploreError, match=message):
        train(small_config(tmp_path, **changes), tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": -1}, "steps must be a whole number"),
        ({"steps": 10**30}, "damaged"),
        ({"steps": 3.5}, "steps must be a whole number"),
        ({"seconds": -1.0}, "seconds must be"),
        ({"evaluations": [{"steps": 3}]}, "'score' is missing in evaluations"),
        ({"evaluations": [{"score": 3.0}]}, "'steps' is missing in evaluations"),
        ({"evaluations": [{"steps": 3, "score": "good"}]}, "score must be a finite number"),
        ({"evaluations": [{"steps": 3, "score": 1.0, "d95": None}]}, "d95 must be a finite number"),
        ({"evaluations": 3}, "evaluations must be a list"),
        ({"evalutions": []}, "evalutions"),
        ({"imitated": 1}, "imitated must be true or false"),
    ],
)
def test_numbers_of_a_checkpoint_that_make_no_sense(
    trained: Path, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    progress = {"algorithm": "FrontierPPO", "steps": 64, "updates": 4, "calls": 0, "format": 1}
    metadata = {"progress": json.dumps({**progress, **changes})}
    safetensors.torch.save_file(tensors(trained), tmp_path / FILE, metadata=metadata)
    with pytest.raises(ResultsError, match=message):
        Run(small_config(tmp_path), tmp_path, device="cpu", resume=True, watcher=Silent())


def test_weights_of_a_checkpoint_that_are_no_numbers(trained: Path, tmp_path: Path) -> None:
    damaged = {name: torch.full_like(values, torch.nan) for name, values in tensors(trained).items()}
    metadata = {"progress": "{}"}
    safetensors.torch.save_file(damaged, tmp_path / FILE, metadata=metadata)
    with pytest.raises(ResultsError, match="is not finite throughout"):
        Run(small_config(tmp_path), tmp_path, device="cpu", resume=True, watcher=Silent())


def test_plans_grow_with_the_steps_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[float] = []
    tell = VectorAdapter.set_attr

    def listen(self: VectorAdapter, attr_name: str, value: Any, indices: Any = None) -> None:
        told.append(value)
        tell(self, attr_name, value, indices)

    monkeypatch.setattr(VectorAdapter, "set_attr", listen)
    config = small_config(tmp_path)
    train(config, tmp_path / "run")
    assert told[0] == 0.0 and len(told) > 1
    assert told == sorted(told) and told[-1] < 1.0


def test_plans_that_grow_do_so_also_between_far_checkpoints(tmp_path: Path) -> None:
    config = small_config(tmp_path)
    whole = dataclasses.replace(config, steps=1000, checkpoint_every=800)
    growing = dataclasses.replace(whole, generator={**config.generator, "first_area": 150.0, "growth": 0.5})
    for one, every in ((whole, 800), (growing, 50)):
        run = Run(one, tmp_path / f"every{every}", device="cpu", resume=False, watcher=Silent())
        assert run._every == every
        run.envs.close()
