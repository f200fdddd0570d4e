"""`layoutexplore evaluate train-predictor`: the predictor `layout`, trained on some buildings and tested on others."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from layoutexplore.maps.floorplan import FloorPlan
    from layoutexplore.predictors.snapshot import Snapshot
    from layoutexplore.training.predictor_samples import Samples, SceneSample, WindowSamples


def train_predictor(
    plans: Annotated[
        list[str], typer.Argument(help="Floor plans: names, FAMILY:FIRST-LAST, splits, files or folders.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the models; use them as layout:model=FOLDER.")],
    folds: Annotated[
        int,
        typer.Option(
            min=0,
            help="Also train on all but one fold of buildings at a time, test there, and keep these models.",
        ),
    ] = 0,
    starts: Annotated[
        int, typer.Option(min=1, help="Explorations per sensor of a plan from a file; others take one.")
    ] = 1,
    stretched: Annotated[
        int,
        typer.Option(
            min=0, help="Copies of each plan from a file, stretched at random, to learn from as well."
        ),
    ] = 0,
    stops: Annotated[int, typer.Option(min=1, help="Decisions kept of an exploration.")] = 8,
    trees: Annotated[int, typer.Option(min=2, help="Trees of a forest; few for a quick try.")] = 200,
    forests: Annotated[bool, typer.Option(help="Train the trees.")] = True,
    network: Annotated[
        bool, typer.Option(help="Train the networks that judge with them (needs torch).")
    ] = True,
    first_steps: Annotated[
        int, typer.Option(min=1, help="Steps of the network for rooms on generated plans alone.")
    ] = 7000,
    steps: Annotated[
        int, typer.Option(min=1, help="Steps of the network for rooms on all plans, in every fold.")
    ] = 3500,
    frontier_steps: Annotated[
        int, typer.Option(min=1, help="Steps of the network for frontiers, in every fold.")
    ] = 1500,
    store: Annotated[
        Path | None, typer.Option(help="Folder that keeps the explorations, to go on or train again later.")
    ] = None,
) -> None:
    """Explore floor plans, train the predictor `layout` on what is seen, and say how it does on buildings it never saw.

    Plans that do not come from files are trained on in every fold and tested in none.
    """
    from layoutexplore.benchmark.plans import find_plans
    from layoutexplore.errors import ConfigError, require
    from layoutexplore.training.predictor_forests import TrainingConfig, deal_groups, train_models
    from layoutexplore.training.predictor_samples import join

    if folds and not forests:
        raise ConfigError("folds are tested with trees and networks: leave --no-forests out, or --folds")
    if network:
        require("torch", "rl")
    seen = _explore(find_plans(plans), starts, stretched, stops, store, forests=forests, network=network)
    groups = _buildings(seen, folds)
    config = TrainingConfig(trees=trees, cell_trees=trees // 2)
    samples = join(seen.samples, groups) if forests else None
    if samples:
        typer.echo(f"{len(samples.closed)} frontiers, {sum(len(c.inside) for c in samples.cells)} cells")
    trainer = _NetworkTrainer(seen, groups, first_steps, steps, frontier_steps) if network else None

    def train(folder: Path, wanted: Callable[[str], bool], held_out: Mapping[str, str]) -> None:
        """All models, of the wanted groups of buildings, into a folder."""
        if samples:
            train_models(samples.of_buildings(wanted), folder, held_out, config)
        if trainer:
            trainer.write(folder, wanted)
        else:
            _forget_networks(folder)
        without = f", trained without {', '.join(sorted(set(held_out.values())))}" if held_out else ""
        typer.echo(f"written: {folder}{without}")

    if folds:
        fold = deal_groups(list(groups.values()), folds)
        models = [out / f"fold{k + 1}" for k in range(folds)]
        for k, folder in enumerate(models):
            held_out = {plan.name: plan.building for plan in seen.files if fold[groups[plan.name]] == k}
            train(folder, lambda group, k=k: fold.get(group) != k, held_out)  # type: ignore[misc]
        _test(seen.asked, {name: models[fold[group]] for name, group in groups.items()})
    train(out, lambda group: True, {})


@dataclass(frozen=True, eq=False)
class _Seen:
    """What explorations have shown.

    Attributes:
        files: Plans from files.
        copies: Names of stretched copies, each with its plan's name.
        samples: For trees, by plan.
        scenes: For the network that judges rooms.
        windows: For those that judge frontiers.
        asked: Decisions for tests, by plan.
    """

    files: list[FloorPlan]
    copies: dict[str, str]
    samples: list[Samples]
    scenes: list[SceneSample]
    windows: list[WindowSamples]
    asked: dict[str, list[Snapshot]]


def _explore(
    sources: Sequence[str],
    starts: int,
    stretched: int,
    stops: int,
    store: Path | None,
    *,
    forests: bool,
    network: bool,
) -> _Seen:
    """Explore plans; those from files more often, and as the tests ask, too."""
    from rich.console import Console

    from layoutexplore.agents import make_agent
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.errors import ConfigError
    from layoutexplore.maps.floorplan import FloorPlan
    from layoutexplore.training.explorations import (
        protocol_explorations,
        stopped_explorations,
        stretched_copies,
    )
    from layoutexplore.training.predictor_samples import gather, gather_scenes, gather_windows

    seen = _Seen([], {}, [], [], [], {})
    with ProgressLine(Console(), "plans") as progress:
        for k, source in enumerate(sources):
            plan = FloorPlan.load(source)
            is_file = Path(source).exists()
            found = list(stopped_explorations(plan, make_agent, starts if is_file else 1, stops, store))
            if is_file:
                protocol = protocol_explorations(plan, make_agent, store)
                found.extend(protocol)
                for copy in stretched_copies(plan, stretched):
                    found.extend(stopped_explorations(copy, make_agent, 1, stops, store))
                    seen.copies[copy.name] = plan.name
                seen.files.append(plan)
                seen.asked[plan.name] = (
                    [snapshot for part in protocol for snapshot in part] if forests else []
                )
            if forests:
                seen.samples.append(gather(found))
            if network:
                for exploration in found:
                    seen.scenes.extend(gather_scenes(exploration))
                    seen.windows.append(gather_windows(exploration, plan.name))
            progress.advance(k + 1, len(sources), (k + 1) / len(sources), plan.name)
    if (forests and not any(len(part.closed) for part in seen.samples)) or (network and not seen.scenes):
        raise ConfigError(
            "nothing to learn from: no exploration stopped before all was seen; give plans of several rooms"
        )
    return seen


def _buildings(seen: _Seen, folds: int) -> dict[str, str]:
    """The group of each plan from a file and of its copies; there are enough of them for the folds."""
    from layoutexplore.errors import ConfigError
    from layoutexplore.training.predictor_samples import group_buildings

    groups = group_buildings(seen.files)
    groups |= {copy: groups[name] for copy, name in seen.copies.items()}
    if folds and not 2 <= folds <= len(set(groups.values())):
        raise ConfigError(
            f"{folds} folds need at least 2 and at most one a building, got {len(set(groups.values()))} buildings"
        )
    return groups


class _NetworkTrainer:
    """Trains networks; those for rooms all begin as one that has learnt from generated plans.

    Args:
        seen: All samples.
        groups: The group of each plan that comes from a file; all others count as generated.
        first_steps: Steps of the network for rooms on generated plans.
        steps: Its steps on all plans.
        frontier_steps: Steps of the frontier network.
    """

    def __init__(
        self, seen: _Seen, groups: Mapping[str, str], first_steps: int, steps: int, frontier_steps: int
    ) -> None:
        from layoutexplore.training.cell_network import NetworkConfig, first_network

        self._config, self._frontier_steps = (
            NetworkConfig(first_steps=first_steps, steps=steps),
            frontier_steps,
        )
        self._seen, self._groups = seen, groups
        self._generated = [sample for sample in seen.scenes if sample.plan not in groups]
        with _steps_line("rooms of generated plans") as progress:
            self._first = first_network(self._generated, self._config, progress)

    def write(self, folder: Path, wanted: Callable[[str], bool]) -> None:
        """Train all networks with the real buildings of the wanted groups and write them into a folder."""
        from layoutexplore.models.network_files import save_weights
        from layoutexplore.predictors.learned import FRONTIER_NETWORK, ROOM_NETWORK
        from layoutexplore.training.cell_network import trained_network
        from layoutexplore.training.frontier_network import FrontierNetworkConfig, trained_frontier_network

        plans = {plan for plan, group in self._groups.items() if wanted(group)}
        real = [sample for sample in self._seen.scenes if sample.plan in plans]
        with _steps_line("rooms of all plans") as progress:
            weights = trained_network(self._first, self._generated, real, self._config, progress)
        note = f"{len(self._generated)} decisions of generated plans, {len(real)} of {len({s.plan for s in real})} others"
        save_weights(
            folder / ROOM_NETWORK.name,
            {name: values.astype("float16") for name, values in weights.items()},
            note,
        )
        generated = [part for part in self._seen.windows if part.plan not in self._groups]
        windows = [part for part in self._seen.windows if part.plan in plans]
        with _steps_line("frontiers of all plans") as progress:
            config = FrontierNetworkConfig(steps=self._frontier_steps)
            rounded = trained_frontier_network(generated, windows, self._groups, config, progress)
        counts = [sum(len(part.closed) for part in parts) for parts in (generated, windows)]
        note = f"{counts[0]} frontiers of generated plans, {counts[1]} of {len({part.plan for part in windows})} others"
        save_weights(folder / FRONTIER_NETWORK.name, rounded, note)


def _forget_networks(folder: Path) -> None:
    """Those of an earlier training would go on judging, and may have learnt from what is held out now."""
    from layoutexplore.predictors.learned import FRONTIER_NETWORK, ROOM_NETWORK

    for path in (FRONTIER_NETWORK, ROOM_NETWORK):
        (folder / path.name).unlink(missing_ok=True)


@contextlib.contextmanager
def _steps_line(what: str) -> Iterator[Callable[[int, int, float], None]]:
    """A progress line over steps, with the loss."""
    from rich.console import Console

    from layoutexplore.cli.progress import ProgressLine

    with ProgressLine(Console(), "steps") as line:
        yield lambda done, total, loss: line.advance(done, total, done / total, f"{what}, loss {loss:.3f}")


def _test(asked: Mapping[str, Sequence[Snapshot]], models: Mapping[str, Path]) -> None:
    """Print how each plan's rooms and frontiers are predicted by the model that never saw its building."""
    from rich.console import Console

    from layoutexplore.cli.partial_rooms import print_summary
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.evaluation.partial_rooms import Scores, score
    from layoutexplore.evaluation.partial_rooms_summary import summarise
    from layoutexplore.predictors import make_room_predictor
    from layoutexplore.predictors.learned import LayoutPredictor

    merged = Scores([], [], {})
    with ProgressLine(Console(), "plans tested") as progress:
        for k, (name, snapshots) in enumerate(asked.items()):
            layout = LayoutPredictor(models[name])
            layout.name = "layout"
            part = score(snapshots, [layout, make_room_predictor("none")])
            merged.rooms.extend(part.rooms)
            merged.frontiers.extend(part.frontiers)
            for predictor, times in part.milliseconds.items():
                merged.milliseconds.setdefault(predictor, []).extend(times)
            progress.advance(k + 1, len(asked), (k + 1) / len(asked), name)
    typer.echo("held out:")
    print_summary(summarise(merged))
