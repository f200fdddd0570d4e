"""Policies on disk: what was saved is what is read, and what is broken says so."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.card import read_card  # noqa: E402
from layoutexplore.agents.rl.networks.actor_critic import Actor  # noqa: E402
from layoutexplore.agents.rl.torch_policy_files import load_actor, save_policy  # noqa: E402
from layoutexplore.errors import ResultsError  # noqa: E402
from tests.agents.rl.cases import observations, random_actor, spec  # noqa: E402


def rewritten(path: Path, **changes: object) -> Path:
    """The policy with another spec in its card."""
    save_policy(path, random_actor().state_dict(), {"policy": {**spec().as_table(), **changes}})
    return path


def test_saved_and_loaded_bit_by_bit(saved: Path) -> None:
    actor, read = load_actor(saved)
    assert read == spec()
    with torch.no_grad():
        assert torch.equal(actor(observations([3, 7])), random_actor()(observations([3, 7])))


def test_whoever_may_read_the_folder_may_read_a_policy(tmp_path: Path) -> None:
    (tmp_path / "other").write_text("")
    save_policy(tmp_path / "a.safetensors", random_actor().state_dict(), {"policy": spec().as_table()})
    assert len({path.stat().st_mode for path in tmp_path.iterdir()}) == 1


def test_a_whole_number_is_a_weight() -> None:
    whole = dataclasses.replace(spec(), network=dataclasses.replace(spec().network, tour_weight=1))
    assert Actor(whole).tour_weight.dtype == torch.float32


def test_the_card_beside_it_is_the_one_inside(saved: Path) -> None:
    import tomllib

    assert tomllib.loads(saved.with_suffix(".toml").read_text()) == read_card(saved)
    assert sorted(p.name for p in saved.parent.iterdir()) == ["trained.safetensors", "trained.toml"]


def test_a_kill_while_writing_leaves_the_old_file(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = saved.read_bytes()

    def killed(path: Path, data: bytes) -> None:
        path.write_text("half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", killed)
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
        ({"tour": {"patience": -1.0}}, "not understood.*tour.patience must be a number from 0"),
        ({"robot_features": ["distance"]}, "weights do not fit"),
    ],
)
def test_another_version_or_other_features(saved: Path, changes: dict[str, object], message: str) -> None:
    with pytest.raises(ResultsError, match=message):
        load_actor(rewritten(saved, **changes))
