"""The environments of a configuration."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from layoutexplore.agents.rl.environments import environment_arguments  # noqa: E402
from tests.agents.rl.cases import small_config  # noqa: E402


def test_arguments_of_the_environments(tmp_path: Path) -> None:
    arguments = environment_arguments(
        small_config(tmp_path, plans=["generated"], generator={"area": [150, 250]}, look_every=0.5)
    )
    assert arguments["look_every"] == 0.5
    assert arguments["plan"].area == (150, 250) and arguments["randomisation"].sensors == ("indoor",)
    assert arguments["predictor"] == "none" and arguments["observation"].detour
