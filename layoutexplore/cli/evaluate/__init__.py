"""`layoutexplore evaluate`: layout methods and predictors against ground truth, a module a command."""

from __future__ import annotations

from collections.abc import Callable

import typer

from layoutexplore.cli.evaluate.closed_doors import closed_doors, train_closed_doors
from layoutexplore.cli.evaluate.clutter import clutter
from layoutexplore.cli.evaluate.foresight import foresight
from layoutexplore.cli.evaluate.in_the_loop import in_the_loop
from layoutexplore.cli.evaluate.layouts import evaluate_layout
from layoutexplore.cli.evaluate.map_noise import map_noise
from layoutexplore.cli.evaluate.partial_rooms import partial_rooms
from layoutexplore.cli.evaluate.ray_fans import train_fans
from layoutexplore.cli.evaluate.registration import registration, train_prior
from layoutexplore.cli.evaluate.robustness import robustness
from layoutexplore.cli.evaluate.segmentation import segmentation
from layoutexplore.cli.evaluate.separator import train_separator
from layoutexplore.cli.evaluate.train_floor import train_floor
from layoutexplore.cli.evaluate.train_merging import train_merging
from layoutexplore.cli.evaluate.train_predictor import train_predictor

COMMANDS: dict[str, Callable[..., None]] = {
    "partial-rooms": partial_rooms,
    "train-predictor": train_predictor,
    "train-floor": train_floor,
    "in-the-loop": in_the_loop,
    "foresight": foresight,
    "robustness": robustness,
    "registration": registration,
    "train-prior": train_prior,
    "closed-doors": closed_doors,
    "train-closed-doors": train_closed_doors,
    "segmentation": segmentation,
    "train": train_merging,
    "train-fans": train_fans,
    "train-separator": train_separator,
    "layout": evaluate_layout,
    "clutter": clutter,
    "map-noise": map_noise,
}
"""What runs, in the order in which the help shows it; the docstring is its help."""

EXAMPLES = {
    "partial-rooms": "office-01 school-01 -p layout -p hull --snapshots kept/",
    "train-predictor": "schools/ office:0-99 --folds 4 --store kept/ --out models/",
    "train-floor": "schools/ office:0-99 --store kept/ --out models/floor.safetensors",
    "in-the-loop": "test -p reconstruct:rose2 -p layout -p oracle --out in-the-loop",
    "foresight": "schools/ -p oracle:horizon=1 -p oracle:horizon=inf --out foresight",
    "robustness": "quick --level low --level middle --out robustness",
    "registration": "test -k true -k rough -k wrong --out registration",
    "train-prior": "train office:1-5 school:1-5 --out confidence",
    "closed-doors": "maps/ --out predicted",
    "train-closed-doors": "maps/ --plans schools/ --cache samples --out models",
    "segmentation": "maps/ recorded/ --leave-out source --out report",
    "train": "maps/ --plans schools/ --out merging_model.json",
    "train-fans": "--plans schools/ --out fan_model.json",
    "train-separator": "--plans schools/ --out separator_network.safetensors",
    "layout": "schools/ -m default -m ias15",
    "clutter": "maps/*.png --out clutter",
    "map-noise": "recorded/ --plans schools/ --plans office:0-9 --out noise.toml --maps simulated/",
}

group = typer.Typer(
    name="evaluate",
    help="Score layout methods, room predictors and noise against ground truth; train what ships.",
    no_args_is_help=True,
)
for _name, _run in COMMANDS.items():
    group.command(_name, epilog=f"Example: layoutexplore evaluate {_name} {EXAMPLES[_name]}")(_run)


def register(app: typer.Typer) -> None:
    """Add `evaluate` to the command line."""
    app.add_typer(group)
