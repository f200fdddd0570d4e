"""`layoutexplore evaluate train-floor`: the network that completes a map by some metres."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Annotated

import typer

from layoutexplore.files import check_file, check_places


def train_floor(
    plans: Annotated[
        list[str],
        typer.Argument(
            metavar="PLANS...", help="Floor plans to learn from: files, folders, splits, FAMILY:SEEDS."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(help="File for the weights; as floor.safetensors in a folder of models it is used."),
    ],
    starts: Annotated[int, typer.Option(min=1, help="Explorations of each plan by each sensor.")] = 1,
    snapshots: Annotated[int, typer.Option(min=1, help="Maps of each exploration.")] = 12,
    copies: Annotated[int, typer.Option(min=0, help="Stretched copies of each plan besides.")] = 1,
    steps: Annotated[int, typer.Option(min=1, help="Steps of the training.")] = 10_000,
    batch: Annotated[int, typer.Option(min=1, help="Crops that a step learns from.")] = 32,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0,
    device: Annotated[str, typer.Option(help="cpu, cuda or auto: cuda where there is one.")] = "auto",
    store: Annotated[
        Path | None,
        typer.Option(help="Folder that keeps explorations and the training; a stopped run goes on."),
    ] = None,
) -> None:
    """Train what layout:ahead=METRES completes a map by, on explorations of floor plans (needs torch).

    As it ships it takes an hour or two on one core. Name it to a predictor by its folder, in which the other
    models lie, too: layout:model=FOLDER,ahead=2.
    """
    from layoutexplore.agents import make_agent
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.errors import require
    from layoutexplore.maps import load_plan
    from layoutexplore.maps.library import find_plans

    check_places(None, out, file="--out", store=store)
    check_file(out, suffixes=(".safetensors",))
    require("torch", "rl")
    from layoutexplore.agents.rl.networks.training_state import chosen_device
    from layoutexplore.models.network_files import save_weights
    from layoutexplore.training.floor_network.crops import crops_of_plans
    from layoutexplore.training.floor_network.network import FloorTrainingConfig, train_floor_network

    names, progress = find_plans(plans), progress_lines()
    config = FloorTrainingConfig(steps=steps, batch=batch, seed=seed, device=chosen_device(device))
    crops = crops_of_plans(
        [load_plan(name) for name in names],
        make_agent,
        starts=starts,
        snapshots=snapshots,
        copies=copies,
        seed=seed,
        store=store,
        progress=progress,
    )
    weights = train_floor_network(
        crops,
        config,
        lambda done, all_steps, loss: progress(f"steps, mean loss {loss:.3f}", done, all_steps),
        kept=store and store / f"floor-{zlib.crc32(crops.data):08x}-{steps}-{batch}-{seed}.safetensors",
    )
    note = f"completes maps; trained on {len(crops)} crops of maps of {len(names)} floor plans, {steps} steps"
    save_weights(out, weights, f"{note}, seed {seed}")
    typer.echo(f"written: {out}")
