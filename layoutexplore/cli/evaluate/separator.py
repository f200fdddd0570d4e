"""`layoutexplore evaluate train-separator`: the network that tells where the borders of rooms run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from layoutexplore.cli.evaluate.options import PlanFolders
from layoutexplore.files import check_file, check_places


def train_separator(
    out: Annotated[Path, typer.Option(help="File for the weights of the network (safetensors).")],
    simulated: Annotated[int, typer.Option(min=1, help="Floor plans to simulate maps of.")] = 4500,
    plans: PlanFolders = None,
    steps: Annotated[int, typer.Option(min=1, help="Steps of the training.")] = 14000,
    batch: Annotated[int, typer.Option(min=1, help="Crops that a step learns from.")] = 64,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0,
    workers: Annotated[
        int, typer.Option(min=0, help="Processes that simulate maps and draw crops beside this one.")
    ] = 0,
    device: Annotated[str, typer.Option(help="cpu, cuda or auto: cuda where there is one.")] = "auto",
    cache: Annotated[
        Path | None, typer.Option(help="Folder that keeps what is learnt from; a stopped run goes on.")
    ] = None,
) -> None:
    """Train what the default method tells the borders of rooms by, on simulated maps (needs torch).

    As it ships it takes some 4 GB of memory, and minutes with a GPU and a dozen workers; hours without.
    """
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.errors import require
    from layoutexplore.maps.library import find_plans

    check_places(None, out, file="--out", cache=cache)
    check_file(out, suffixes=(".safetensors",))
    require("torch", "rl")
    from layoutexplore.agents.rl.networks.training_state import chosen_device
    from layoutexplore.models.network_files import save_weights
    from layoutexplore.training.separator.network import SeparatorTrainingConfig, train_shipped_separator

    names = find_plans(plans or ())
    config = SeparatorTrainingConfig(
        steps=steps, batch=batch, seed=seed, workers=workers, device=chosen_device(device)
    )
    weights = train_shipped_separator(simulated, names, config, cache=cache, progress=progress_lines())
    note = f"borders of rooms; trained on maps of {simulated} floor plans in {steps} steps, seed {seed}"
    save_weights(out, weights, note)
    typer.echo(f"written: {out}")
