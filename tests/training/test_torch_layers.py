"""The training loop of small networks: what it keeps, and files that are no such thing."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

from layoutexplore.agents.rl.torch_policy_files import save_tensors  # noqa: E402
from layoutexplore.errors import ConfigError  # noqa: E402
from layoutexplore.files.tensors import read_tensors  # noqa: E402
from layoutexplore.training.torch_layers import fit_network  # noqa: E402


def train(kept: Path) -> None:
    network = torch.nn.Conv2d(1, 2, 3)

    def losses(step: int) -> tuple[torch.Tensor, torch.Tensor]:
        loss = network(torch.ones(1, 1, 3, 3)).square().mean()
        return loss, loss

    fit_network(network, losses, steps=2, rate=0.1, decay=0.0, progress=lambda *_: None, kept=kept)


@pytest.mark.parametrize("name", ["optimizer.x.step", "optimizer.2.step", "optimizer.0.exp_avg"])
def test_a_damaged_state_is_told(tmp_path: Path, name: str) -> None:
    kept = tmp_path / "state.safetensors"
    train(kept)
    train(kept)
    arrays, metadata = read_tensors(kept)
    tensors = {key: torch.from_numpy(values.copy()) for key, values in arrays.items()}
    save_tensors(kept, tensors | {name: torch.zeros(5)}, metadata)
    with pytest.raises(ConfigError, match="damaged"):
        train(kept)
