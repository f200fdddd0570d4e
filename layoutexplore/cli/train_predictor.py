"""`layoutexplore evaluate train-predictor`: the trees of the predictor `layout`, trained and tested on other buildings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from layoutexplore.floorplan import FloorPlan
    from layoutexplore.snapshot import Snapshot


def train_predictor(
    plans: Annotated[list[str], typer.Argument(help="Floor plans: names, FAMILY:FIRST-LAST, splits, files or folders.")],
    out: Annotated[Path, typer.Option(help="Folder for the models; use them as layout:model=FOLDER.")],
    folds: Annotated[
        int, typer.Option(min=0, help="Also train on all but one fold of buildings at a time, test there, and keep these models.")
    ] = 0,
    starts: Annotated[int, typer.Option(min=1, help="Explorations per sensor of a plan from a file; others take one.")] = 1,
    stops: Annotated[int, typer.Option(min=1, help="Decisions kept of an exploration.")] = 8,
    trees: Annotated[int, typer.Option(min=2, help="Trees of a forest; few for a quick try.")] = 200,
    store: Annotated[Path | None, typer.Option(help="Folder that keeps the explorations, to go on or train again later.")] = None,
) -> None:
    """Explore floor plans, train the predictor `layout` on what is seen, and say how it does on buildings it never saw.

    Generated plans are trained on in every fold and tested in none.
    """
    from rich.console import Console

    from layoutexplore.agents import make_agent
    from layoutexplore.benchmark.plans import find_plans
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.errors import ConfigError
    from layoutexplore.evaluation.explorations import protocol_explorations, stopped_explorations
    from layoutexplore.floorplan import FloorPlan
    from layoutexplore.predictors.samples import gather, group_buildings
    from layoutexplore.predictors.training import TrainingConfig, deal_groups, train_models

    config = TrainingConfig(trees=trees, cell_trees=trees // 2)
    sources = find_plans(plans)
    explored: list[list[Snapshot]] = []
    asked: dict[str, list[Snapshot]] = {}
    files: list[FloorPlan] = []
    with ProgressLine(Console(), "plans") as progress:
        for k, source in enumerate(sources):
            plan = FloorPlan.load(source)
            is_file = Path(source).exists()
            explored.extend(stopped_explorations(plan, make_agent, starts if is_file else 1, stops, store))
            if is_file:
                files.append(plan)
                protocol = protocol_explorations(plan, make_agent, store)
                explored.extend(protocol)
                asked[plan.name] = [snapshot for part in protocol for snapshot in part]
            progress.advance(k + 1, len(sources), (k + 1) / len(sources), plan.name)
    groups = group_buildings(files)
    if folds and not 2 <= folds <= len(set(groups.values())):
        raise ConfigError(f"{folds} folds need at least 2 and at most one a building, got {len(set(groups.values()))} buildings")
    samples = gather(explored, groups)
    typer.echo(f"{len(samples.closed)} frontiers, {sum(len(c.inside) for c in samples.cells)} cells, {len(sources)} plans")
    if folds:
        fold = deal_groups(list(groups.values()), folds)
        models = [out / f"fold{k + 1}" for k in range(folds)]
        for k, folder in enumerate(models):
            held_out = {plan.name: plan.building for plan in files if fold[groups[plan.name]] == k}
            kept = samples.of_buildings(lambda group, k=k: fold.get(group) != k)  # type: ignore[misc]
            train_models(kept, folder, held_out, config)
            typer.echo(f"written: {folder}, trained without {', '.join(sorted(set(held_out.values())))}")
        _test(asked, {name: models[fold[group]] for name, group in groups.items()})
    train_models(samples, out, {}, config)
    typer.echo(f"written: {out}")


def _test(asked: Mapping[str, Sequence[Snapshot]], models: Mapping[str, Path]) -> None:
    """Print how each plan's rooms and frontiers are predicted by the model that never saw its building."""
    from rich.console import Console

    from layoutexplore.cli.partial_rooms import print_summary
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.evaluation.partial_rooms import Scores, score
    from layoutexplore.evaluation.partial_rooms_summary import summarise
    from layoutexplore.predictors import make_room_predictor
    from layoutexplore.predictors.layout import LayoutPredictor

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
