"""`layoutexplore train`: train an exploration policy."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

    from layoutexplore.agents.rl.hyperparameters import TrainingConfig
    from layoutexplore.agents.rl.run import TrainingRun
    from layoutexplore.cli.progress import ProgressLine

HELP = """Train an exploration policy (needs pip install 'layoutexplore\\[rl]').

By default it learns the numbers of a tour over frontiers, from whole explorations, as `policy:tour` has; \
`policy` is a network of maskable-ppo. The
folder gets the configuration, a checkpoint, the last and the best policy (best.safetensors), the \
evaluations on held-out plans
(evaluations.csv) and TensorBoard curves. Ctrl-C leaves a checkpoint; [bold]--resume[/bold] goes on from it.

[bold]Examples[/bold]

  layoutexplore train --out runs/first

  layoutexplore train --out runs/first --resume

  layoutexplore train --out runs/first --curve

  layoutexplore train --algorithm maskable-ppo --steps 100000 --out runs/network

  layoutexplore benchmark --plans test --agents tour --agents policy:runs/first
"""


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("train", help=HELP)(train)


Algorithm = Annotated[
    str | None,
    typer.Option(
        help="tour-search (the parameters of a tour over frontiers, by whole explorations: the default), "
        "maskable-ppo (a network that scores frontiers), or ppo or dqn (drive by small motions)."
    ),
]

Device = Annotated[
    str, typer.Option(help="cpu, cuda or auto: cuda where there is one, but cpu for networks of frontiers.")
]


def train(
    config: Annotated[
        Path | None,
        typer.Argument(metavar="[CONFIG.toml]", help="Hyper-parameters that differ from the shipped ones."),
    ] = None,
    algorithm: Algorithm = None,
    steps: Annotated[
        int | None,
        typer.Option(min=1, help="Steps of all environments together; of tour-search, explorations."),
    ] = None,
    envs: Annotated[int | None, typer.Option(min=1, help="Environments side by side.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of everything.")] = None,
    device: Device = "auto",
    predictor: Annotated[
        str | None,
        typer.Option(help="Where a policy learns of rooms from: layout, none, or oracle (the true rooms)."),
    ] = None,
    sensor: Annotated[
        list[str] | None,
        typer.Option(help="Lidar: stage, indoor, short or mapex; environments take turns. [repeatable]"),
    ] = None,
    plans: Annotated[
        list[str] | None,
        typer.Option(help="Floor plans to train on, as for benchmark, or generated. [repeatable]"),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the run.")] = Path("layoutexplore-out/training"),
    resume: Annotated[
        bool, typer.Option(help="Go on with the run of the folder; --steps may be raised.")
    ] = False,
    curve: Annotated[
        bool, typer.Option("--curve", help="Only print the evaluations of the folder's run, as a table.")
    ] = False,
) -> None:
    """Train a policy."""
    from layoutexplore.agents.rl.hyperparameters import read_config
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.errors import require
    from layoutexplore.files import check_places

    if curve:
        typer.echo(_curve(out))
        return
    check_places(out)
    flags = {
        "algorithm": algorithm,
        "steps": steps,
        "envs": envs,
        "seed": seed,
        "predictor": predictor,
        "sensors": sensor or None,
        "plans": plans or None,
    }
    if resume:
        config = _kept_config(out, config, flags)
    settings = read_config(config, flags)
    for module in ("torch", "stable_baselines3", "sb3_contrib", "safetensors", "tensorboard"):
        require(module, "rl")
    with ProgressLine(plain_console(), "steps") as line:
        _run(settings, out, device, resume, line)


class _Watcher:
    """Shows a run on a progress line."""

    def __init__(self, line: ProgressLine) -> None:
        self._line = line
        self._first: tuple[float, int] | None = None

    def say(self, text: str) -> None:
        self._line.say_plain(text)

    def advance(self, steps: int, total: int) -> None:
        now = time.monotonic()
        if self._first is None:
            self._first = now, steps
        began, first = self._first
        rate = (steps - first) / max(now - began, 1e-3)
        share = (steps - first) / max(total - first, 1)
        self._line.advance(min(steps, total), total, min(share, 1.0), f"{rate:.0f} steps/s")


def _kept_config(out: Path, config: Path | None, flags: dict[str, Any]) -> Path:
    """The configuration of the run in a folder; nothing else may be given but `--steps`."""
    from layoutexplore.errors import ConfigError, ResultsError

    fixed = [f"--{name}" for name, value in flags.items() if value is not None and name != "steps"]
    if config is not None:
        fixed.append(str(config))
    if fixed:
        raise ConfigError(f"--resume goes on with the configuration of {out}: leave out {fixed[0]}")
    kept = out / "config.toml"
    if not kept.exists():
        raise ResultsError(f"no training run in {out}: leave out --resume to start one there")
    return kept


def _curve(out: Path) -> str:
    """The evaluations of the run in a folder as a table."""
    from layoutexplore.errors import ResultsError, require

    require("stable_baselines3", "rl")
    from layoutexplore.agents.rl.evaluation import curve_table, read_evaluations
    from layoutexplore.agents.rl.run import EVALUATIONS

    evaluations = read_evaluations(out / EVALUATIONS)
    if not evaluations:
        raise ResultsError(f"no evaluations in {out / EVALUATIONS}: train there first, or give another --out")
    return curve_table(evaluations)


def _run(settings: TrainingConfig, out: Path, device: str, resume: bool, line: ProgressLine) -> None:
    from layoutexplore.agents.rl.tour_search.search import SearchRun
    from layoutexplore.agents.rl.training import Run
    from layoutexplore.files.locking import held

    make: Callable[..., TrainingRun] = SearchRun if settings.search else Run
    with held(out, "training"):
        run = make(settings, out, device=device, resume=resume, watcher=_Watcher(line))
        run.train()
    if run.stopping:
        line.say_plain(f"stopped after {run.steps} steps; to go on: layoutexplore train --out {out} --resume")
    elif settings.chooses_frontiers:
        line.say_plain(
            f"the best policy: {out / 'best.safetensors'}; layoutexplore benchmark --agents tour --agents "
            f"policy:{out}"
        )
    else:
        line.say_plain(f"the best policy: {out / 'best.safetensors'}; TensorBoard: {out / 'tensorboard'}")
