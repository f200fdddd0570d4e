"""Cards: what is read of them, and where policies are looked for."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

import safetensors.numpy  # noqa: E402

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.policy import load_policy  # noqa: E402
from layoutexplore.agents.rl.card import WEIGHTS, find_policy, read_card, read_spec  # noqa: E402
from layoutexplore.agents.rl.torch_policy_files import load_actor, save_tensors  # noqa: E402
from layoutexplore.errors import ConfigError, ResultsError, UnknownNameError  # noqa: E402
from tests.calls import counted_calls  # noqa: E402


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


def test_where_policies_are_looked_for(saved: Path, tmp_path: Path) -> None:
    assert find_policy(str(saved)) == saved
    with pytest.raises(ConfigError, match="has neither best"):
        find_policy(str(tmp_path))
    saved.rename(tmp_path / "best.safetensors")
    assert find_policy(str(tmp_path)) == tmp_path / "best.safetensors"
    with pytest.raises(ConfigError, match="there is no policy"):
        make_agent(f"policy:{tmp_path / 'gone.safetensors'}")
    with pytest.raises(ConfigError, match="there is no policy ~nobody-at-all/gone"):
        find_policy("~nobody-at-all/gone")
    with pytest.raises(UnknownNameError, match="unknown policy 'nobody'"):
        make_agent("policy:nobody")


def test_what_ships_can_be_read() -> None:
    for path in sorted(WEIGHTS.glob("*.safetensors")):
        _, read = load_actor(path)
        assert dataclasses.asdict(read)["format"] == 1
        assert path.stat().st_size < 5_000_000
        card = read_card(path)
        assert {"policy", "training", "results", "limits"} <= set(card)
        assert make_agent(f"policy:{path.stem}").predictor == read.predictor


@pytest.mark.parametrize(
    ("tensors", "message"),
    [
        ({f"t{k}": np.zeros(0, np.float32) for k in range(50_000)}, "50000 tensors, and 10000 is the most"),
        ({"x" * 1_000_000: np.zeros(0, np.float32)}, "1000000 characters, and 200 is the most"),
    ],
)
def test_files_with_more_than_any_policy_has_are_refused_at_once(
    tmp_path: Path, tensors: dict[str, Any], message: str
) -> None:
    path = tmp_path / "many.safetensors"
    safetensors.numpy.save_file(tensors, path, metadata={"card": ""})
    with counted_calls() as calls, pytest.raises(ResultsError, match=message):
        load_policy("many", str(path))
    assert 0 < calls.total() < 10_000


def test_a_name_that_is_none_is_told_with_what_else_does() -> None:
    with pytest.raises(UnknownNameError, match=r"a folder of `layoutexplore train` does, too"):
        make_agent("policy:nofile")
