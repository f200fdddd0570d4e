"""A policy that was saved."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    pytest.importorskip("torch")
    from layoutexplore.agents.rl.torch_policy_files import save_policy
    from tests.agents.rl.cases import random_actor, spec

    path, training = tmp_path / "trained.safetensors", {"steps_done": 3}
    save_policy(path, random_actor().state_dict(), {"policy": spec().as_table(), "training": training})
    return path
