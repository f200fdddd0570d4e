"""`layoutexplore evaluate`: layout methods and predictors against ground truth, a module a command."""

from __future__ import annotations

from collections.abc import Callable

import typer

from layoutexplore.cli.evaluate.closed_doors import HELP as CLOSED_DOORS_HELP
from layoutexplore.cli.evaluate.closed_doors import closed_doors, train_closed_doors
from layoutexplore.cli.evaluate.clutter import HELP as CLUTTER_HELP
from layoutexplore.cli.evaluate.clutter import clutter
from layoutexplore.cli.evaluate.foresight import HELP as FORESIGHT_HELP
from layoutexplore.cli.evaluate.foresight import foresight
from layoutexplore.cli.evaluate.in_the_loop import HELP as IN_THE_LOOP_HELP
from layoutexplore.cli.evaluate.in_the_loop import in_the_loop
from layoutexplore.cli.evaluate.layouts import evaluate_layout
from layoutexplore.cli.evaluate.map_noise import HELP as MAP_NOISE_HELP
from layoutexplore.cli.evaluate.map_noise import map_noise
from layoutexplore.cli.evaluate.partial_rooms import HELP as PARTIAL_ROOMS_HELP
from layoutexplore.cli.evaluate.partial_rooms import partial_rooms
from layoutexplore.cli.evaluate.ray_fans import train_fans
from layoutexplore.cli.evaluate.registration import (
    REGISTRATION_HELP,
    TRAIN_PRIOR_HELP,
    registration,
    train_prior,
)
from layoutexplore.cli.evaluate.robustness import HELP as ROBUSTNESS_HELP
from layoutexplore.cli.evaluate.robustness import robustness
from layoutexplore.cli.evaluate.segmentation import segmentation
from layoutexplore.cli.evaluate.separator import train_separator
from layoutexplore.cli.evaluate.train_merging import train_merging
from layoutexplore.cli.evaluate.train_predictor import HELP as TRAIN_PREDICTOR_HELP
from layoutexplore.cli.evaluate.train_predictor import train_predictor

COMMANDS: dict[str, tuple[Callable[..., None], str | None]] = {
    "partial-rooms": (partial_rooms, PARTIAL_ROOMS_HELP),
    "train-predictor": (train_predictor, TRAIN_PREDICTOR_HELP),
    "in-the-loop": (in_the_loop, IN_THE_LOOP_HELP),
    "foresight": (foresight, FORESIGHT_HELP),
    "robustness": (robustness, ROBUSTNESS_HELP),
    "registration": (registration, REGISTRATION_HELP),
    "train-prior": (train_prior, TRAIN_PRIOR_HELP),
    "closed-doors": (closed_doors, CLOSED_DOORS_HELP),
    "train-closed-doors": (train_closed_doors, None),
    "segmentation": (segmentation, None),
    "train": (train_merging, None),
    "train-fans": (train_fans, None),
    "train-separator": (train_separator, None),
    "layout": (evaluate_layout, None),
    "clutter": (clutter, CLUTTER_HELP),
    "map-noise": (map_noise, MAP_NOISE_HELP),
}
"""What runs, and its help where that is not its docstring, in the order in which the help shows them."""

EXAMPLES = {
    "partial-rooms": "office-01 school-01 -p layout -p hull --snapshots kept/",
    "train-predictor": "schools/ office:0-99 --folds 4 --store kept/ --out models/",
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
    "clutter": "maps/*.png",
    "map-noise": "recorded/ --plans schools/ --plans office:0-9 --out noise.toml --maps simulated/",
}

group = typer.Typer(
    name="evaluate",
    help="Score layout methods, room predictors and noise against ground truth; train what ships.",
    no_args_is_help=True,
)
for _name, (_run, _help) in COMMANDS.items():
    group.command(_name, help=_help, epilog=f"Example: layoutexplore evaluate {_name} {EXAMPLES[_name]}")(
        _run
    )


def register(app: typer.Typer) -> None:
    """Add `evaluate` to the command line."""
    app.add_typer(group)
