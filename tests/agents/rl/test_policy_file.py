"""Policies on disk and as agents: what was saved is what acts, and what is broken says so."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.agent import NetworkPolicy  # noqa: E402
from layoutexplore.agents.rl.card import WEIGHTS, find_policy, read_card, read_spec  # noqa: E402
from layoutexplore.agents.rl.policy_file import load_actor, save_policy, save_tensors  # noqa: E402
from layoutexplore.benchmark.episode import prepare  # noqa: E402
from layoutexplore.errors import ConfigError, MissingExtraError, ResultsError, UnknownNameError  # noqa: E402
from layoutexplore.simulation.config import SimulationConfig  # noqa: E402
from layoutexplore.simulation.episode import play  # noqa: E402
from tests.agents.rl.cases import observations, random_actor, spec  # noqa: E402


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "trained.safetensors"
    save_policy(
        path, random_actor().state_dict(), {"policy": spec().as_table(), "training": {"steps_done": 3}}
    )
    return path


def rewritten(path: Path, **changes: object) -> Path:
    """The policy with another spec in its card."""
    save_policy(path, random_actor().state_dict(), {"policy": {**spec().as_table(), **changes}})
    return path


def test_saved_and_loaded_bit_by_bit(saved: Path) -> None:
    actor, read = load_actor(saved)
    assert read == spec()
    with torch.no_grad():
        assert torch.equal(actor(observations([3, 7])), random_actor()(observations([3, 7])))


def test_the_card_beside_it_is_the_one_inside(saved: Path) -> None:
    import tomllib

    assert tomllib.loads(saved.with_suffix(".toml").read_text()) == read_card(saved)
    assert sorted(p.name for p in saved.parent.iterdir()) == ["trained.safetensors", "trained.toml"]


def test_a_kill_while_writing_leaves_the_old_file(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = saved.read_bytes()

    def killed(tensors: object, path: Path, metadata: object) -> None:
        Path(path).write_bytes(b"half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr("safetensors.torch.save_file", killed)
    with pytest.raises(KeyboardInterrupt):
        save_policy(saved, random_actor(seed=1).state_dict(), {"policy": spec().as_table()})
    assert saved.read_bytes() == before
    assert sorted(p.name for p in saved.parent.iterdir()) == ["trained.safetensors", "trained.toml"]


@pytest.mark.parametrize("kept", [0, 4, 100, 0.5, -1])
def test_a_truncated_file(saved: Path, kept: float) -> None:
    whole = saved.read_bytes()
    saved.write_bytes(whole[: int(kept * len(whole)) if isinstance(kept, float) else kept])
    with pytest.raises(ResultsError, match=r"damaged|not a policy"):
        make_agent(f"policy:{saved}")


@pytest.mark.parametrize(
    "content", [b"\x80\x04pickle", b"PK\x03\x04 zipped torch file", b"{}", (2).to_bytes(8, "little") + b"{}"]
)
def test_a_file_of_something_else(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.safetensors"
    path.write_bytes(content)
    with pytest.raises(ResultsError, match="not a policy"):
        read_spec(path)


def test_safetensors_of_somebody_else(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    save_tensors(path, {"w": torch.zeros(3)}, {"card": "name = 3"})
    with pytest.raises(ResultsError, match="no table"):
        read_spec(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": 99}, "format 99.*which reads format 1"),
        (
            {"frontier_features": ["tour_rank", "smell"]},
            "frontier features that this version does not have: smell",
        ),
        ({"robot_features": ["mood"]}, "robot features that this version does not have: mood"),
        ({"taste": 1}, "not understood"),
        ({"network": {"depth": 3}}, "not understood"),
        ({"tour": {"hurry": 3.0}}, "not understood"),
        ({"tour": {"patience": -1.0}}, "not understood.*tour.patience must be a finite number"),
        ({"robot_features": ["distance"]}, "weights do not fit"),
    ],
)
def test_another_version_or_other_features(saved: Path, changes: dict[str, object], message: str) -> None:
    with pytest.raises(ResultsError, match=message):
        load_actor(rewritten(saved, **changes))


def test_where_policies_are_looked_for(saved: Path, tmp_path: Path) -> None:
    assert find_policy(str(saved)) == saved
    with pytest.raises(ConfigError, match="has neither best"):
        find_policy(str(tmp_path))
    saved.rename(tmp_path / "best.safetensors")
    assert find_policy(str(tmp_path)) == tmp_path / "best.safetensors"
    with pytest.raises(ConfigError, match="there is no policy"):
        make_agent(f"policy:{tmp_path / 'gone.safetensors'}")
    with pytest.raises(UnknownNameError, match="unknown policy 'nobody'"):
        make_agent("policy:nobody")


def test_without_torch_the_line_to_install_it_is_named(monkeypatch: pytest.MonkeyPatch, saved: Path) -> None:
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(MissingExtraError, match=r"layoutexplore\[rl\]"):
        make_agent(f"policy:{saved}")


def test_its_name_and_predictor(saved: Path) -> None:
    agent = make_agent(f"policy:{saved}")
    assert isinstance(agent, NetworkPolicy)
    assert (agent.name, agent.predictor) == (f"policy:{saved}", "none")
    assert make_agent(f"policy:path={saved}").name == agent.name


@pytest.mark.parametrize("encoder", ["attention", "deep-sets", "none"])
def test_an_untrained_policy_explores_as_the_tour(encoder: str) -> None:
    from layoutexplore.agents.rl.networks.actor_critic import Actor

    config = SimulationConfig(sensor="indoor")
    simulation, tour = prepare("apartment-01", config, "latency-tour")
    expected = play(simulation, tour, seed=3)
    agent = NetworkPolicy("untrained", Actor(spec(encoder)).eval(), spec(encoder))
    np.testing.assert_array_equal(play(simulation, agent, seed=3).curve, expected.curve)
    np.testing.assert_array_equal(play(simulation, agent, seed=3).curve, expected.curve)


def test_what_ships_can_be_read() -> None:
    for path in sorted(WEIGHTS.glob("*.safetensors")):
        _, read = load_actor(path)
        assert dataclasses.asdict(read)["format"] == 1
        assert path.stat().st_size < 5_000_000
        card = read_card(path)
        assert {"policy", "training", "results", "limits"} <= set(card)
        assert make_agent(f"policy:{path.stem}").predictor == read.predictor
