"""`layoutexplore evaluate train-predictor`: trains the predictor `layout`, tests it on other buildings."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from layoutexplore.cli.evaluate.options import holding

if TYPE_CHECKING:
    from layoutexplore.evaluation.partial_rooms import Scores
    from layoutexplore.predictors.snapshot import Snapshot
    from layoutexplore.training.predictor import ExplorationConfig, Explored
    from layoutexplore.training.predictor_samples import PredictorSamples


Plans = Annotated[
    list[str], typer.Argument(help="Floor plans: names, FAMILY:FIRST-LAST, splits, files or folders.")
]
Out = Annotated[Path, typer.Option(help="Folder for the models; use them as layout:model=FOLDER.")]
Folds = Annotated[
    int,
    typer.Option(
        min=0,
        help="Also train on all but one fold of buildings at a time, test there, and keep these models.",
    ),
]
LeaveOut = Annotated[
    Literal["source"] | None,
    typer.Option(
        help="Also train without each source, which is what one word of PLANS names, and test there."
    ),
]
Starts = Annotated[
    int, typer.Option(min=1, help="Explorations per sensor of a plan from a file; others take one.")
]
Stretched = Annotated[
    int,
    typer.Option(min=0, help="Copies of each plan from a file, stretched at random, to learn from as well."),
]
Stops = Annotated[int, typer.Option(min=1, help="Decisions kept of an exploration.")]
Trees = Annotated[int, typer.Option(min=2, help="Trees of a forest; few for a quick try.")]
Forests = Annotated[bool, typer.Option(help="Train the trees.")]
Network = Annotated[bool, typer.Option(help="Train the networks that judge with them (needs torch).")]
FirstSteps = Annotated[
    int, typer.Option(min=1, help="Steps of the network for rooms on generated plans alone.")
]
Steps = Annotated[
    int, typer.Option(min=1, help="Steps of the network for rooms on all plans, in every fold.")
]
FrontierSteps = Annotated[int, typer.Option(min=1, help="Steps of the network for frontiers, in every fold.")]
Doubtful = Annotated[
    list[str] | None,
    typer.Option(
        metavar="WORD",
        help="Word of PLANS whose rooms are less certain, such as maps whose rooms were found by a method: "
        "only half of the trees that judge frontiers learn from it.",
    ),
]
RoomsOf = Annotated[
    str | None,
    typer.Option(
        metavar="FOLDER",
        help="Take the models that judge rooms from this folder, or the `shipped` ones, and train only those "
        "for frontiers. What is held out here they may have learnt from.",
    ),
]
Store = Annotated[
    Path | None, typer.Option(help="Folder that keeps the explorations, to go on or train again later.")
]


Train = Callable[[Path, Callable[[str], bool], Mapping[str, str]], None]
"""Trains all models, of the wanted groups of buildings, into a folder; notes what is held out."""


def train_predictor(
    plans: Plans,
    out: Out,
    folds: Folds = 0,
    leave_out: LeaveOut = None,
    starts: Starts = 1,
    stretched: Stretched = 0,
    stops: Stops = 8,
    trees: Trees = 200,
    forests: Forests = True,
    network: Network = True,
    first_steps: FirstSteps = 7000,
    steps: Steps = 3500,
    frontier_steps: FrontierSteps = 1500,
    rooms_of: RoomsOf = None,
    doubtful: Doubtful = None,
    store: Store = None,
) -> None:
    """Train the predictor `layout` on explored floor plans, and test it on other buildings.

    Plans that do not come from files are trained on in every fold and tested in none.
    """
    from layoutexplore.errors import require
    from layoutexplore.files import all_or_none, check_places
    from layoutexplore.training import predictor
    from layoutexplore.training.predictor_forests import PredictorForestConfig, train_models

    _check_held_out(folds, leave_out, forests)
    _check_doubtful(doubtful or (), plans)
    if network:
        require("torch", "rl")
    check_places(out, store=store)
    with holding(out):
        taken = predictor.rooms_of(rooms_of) if rooms_of else {}
        rooms = not taken
        explorations = predictor.ExplorationConfig(
            starts=starts, stretched=stretched, stops=stops, store=store
        )
        seen = _explore(plans, explorations, forests=forests, network=network, rooms=rooms)
        groups = predictor.buildings_of(seen, folds)
        held_out = _parts(seen, groups, folds, plans if leave_out else ())
        less_certain = predictor.buildings_of_words(seen, groups, _sources(plans), doubtful or ())
        config = PredictorForestConfig(trees=trees, cell_trees=trees // 2, doubtful=less_certain)
        samples = _samples(seen, groups) if forests else None
        lengths = first_steps, steps, frontier_steps
        trainer = (
            predictor.NetworkTrainer(seen, groups, *lengths, _steps_line, rooms=rooms) if network else None
        )

        def train(folder: Path, wanted: Callable[[str], bool], unseen: Mapping[str, str]) -> None:
            with all_or_none(folder) as models:
                if samples:
                    train_models(samples.of_buildings(wanted), models, unseen, config)
                if trainer:
                    trainer.write(models, wanted)
                predictor.write_rooms(models, taken)
                predictor.forget_networks(folder)
            without = f", trained without {', '.join(sorted(set(unseen.values())))}" if unseen else ""
            typer.echo(f"written: {folder}{without}")

        if held_out:
            _train_parts(train, seen, groups, held_out, out, by_part=leave_out is not None)
        train(out, lambda group: True, {})


def _samples(seen: Explored, groups: Mapping[str, str]) -> PredictorSamples:
    """What trees learn from, and how much there is of it."""
    from layoutexplore.training.predictor_samples import join_samples

    samples = join_samples(seen.samples, groups)
    typer.echo(f"{len(samples.closed)} frontiers, {sum(len(c.inside) for c in samples.cells)} cells")
    return samples


def _explore(
    plans: Sequence[str], config: ExplorationConfig, *, forests: bool, network: bool, rooms: bool
) -> Explored:
    """Explore plans under a progress line."""
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.maps.library import find_plans
    from layoutexplore.training.predictor import explore_plans

    sources = find_plans(plans)
    with ProgressLine(plain_console(), "plans") as line:

        def advance(done: int, total: int, name: str) -> None:
            line.advance(done, total, done / total, name)

        return explore_plans(sources, config, forests=forests, network=network, rooms=rooms, progress=advance)


def _check_held_out(folds: int, leave_out: LeaveOut, forests: bool) -> None:
    """Refuse what does not go together."""
    from layoutexplore.errors import ConfigError

    if folds and leave_out:
        raise ConfigError("--folds and --leave-out are two ways to hold plans out: choose one")
    if (folds or leave_out) and not forests:
        raise ConfigError("what is held out is tested with trees and networks: leave --no-forests out")


def _parts(seen: Explored, groups: Mapping[str, str], folds: int, words: Sequence[str]) -> dict[str, str]:
    """What each group of buildings is held out with: a fold, or a source by name where words name them."""
    from layoutexplore.training.folds import deal_folds
    from layoutexplore.training.predictor import parts_by_source

    if words:
        return parts_by_source(seen, groups, _sources(words))
    if not folds:
        return {}
    return {group: f"fold{k + 1}" for group, k in deal_folds(groups.values(), folds, "name").items()}


def _check_doubtful(doubtful: Sequence[str], plans: Sequence[str]) -> None:
    """Refuse, before anything is explored, words that name no floor plan from a file."""
    from layoutexplore.errors import ConfigError, shortened
    from layoutexplore.files import is_there
    from layoutexplore.maps.formats.building_files import split_level

    for word in doubtful:
        found = _sources([word])[word] if word in plans else []
        if not any(is_there(split_level(source)[0]) for source in found):
            raise ConfigError(
                f"--doubtful {shortened(word)} is no word of PLANS that names floor plans from files"
            )


def _sources(words: Sequence[str]) -> dict[str, list[str]]:
    """What can be loaded of each word of PLANS."""
    from layoutexplore.maps.library import find_plans

    return {word: find_plans([word]) for word in words}


def _train_parts(
    train: Train,
    seen: Explored,
    groups: Mapping[str, str],
    parts: Mapping[str, str],
    out: Path,
    *,
    by_part: bool,
) -> None:
    """Train on all but one part at a time, keep the models, and print how each does on its part."""
    for part in dict.fromkeys(parts.values()):
        unseen = {plan.name: plan.building for plan in seen.files if parts[groups[plan.name]] == part}
        train(out / part, lambda group, part=part: parts.get(group) != part, unseen)  # type: ignore[misc]
    scores = _test(seen.asked, {name: out / parts[groups[name]] for name in seen.asked})
    typer.echo("held out:")
    if by_part:
        _print_parts(scores, {name: parts[groups[name]] for name in seen.asked})
    _print_all(scores)


@contextlib.contextmanager
def _steps_line(what: str) -> Iterator[Callable[[int, int, float], None]]:
    """A progress line over steps, with the loss."""
    from layoutexplore.cli.progress import ProgressLine, plain_console

    with ProgressLine(plain_console(), "steps") as line:
        yield lambda done, total, loss: line.advance(done, total, done / total, f"{what}, loss {loss:.3f}")


def _test(asked: Mapping[str, Sequence[Snapshot]], models: Mapping[str, Path]) -> Scores:
    """How each plan's rooms and frontiers are predicted by the model that never saw its building."""
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.evaluation.partial_rooms import Scores, score_predictors
    from layoutexplore.predictors import make_room_predictor
    from layoutexplore.predictors.learned import LearnedPredictor

    merged = Scores([], [], {})
    with ProgressLine(plain_console(), "plans tested") as progress:
        for k, (name, snapshots) in enumerate(asked.items()):
            layout = LearnedPredictor(models[name])
            layout.name = "layout"
            merged.extend(score_predictors(snapshots, [layout, make_room_predictor("none")]))
            progress.advance(k + 1, len(asked), (k + 1) / len(asked), name)
    return merged


def _print_all(scores: Scores) -> None:
    from layoutexplore.cli.evaluate.partial_rooms import print_summary
    from layoutexplore.evaluation.partial_rooms_summary import summarise_partial_rooms

    print_summary(summarise_partial_rooms(scores))


def _print_parts(scores: Scores, part_of: Mapping[str, str]) -> None:
    """One line a part that was left out, for the predictor `layout`."""
    from layoutexplore.cli.evaluate.partial_rooms import shown
    from layoutexplore.cli.progress import print_table
    from layoutexplore.evaluation.partial_rooms_summary import summarise_parts

    lines = [asdict(line) for line in summarise_parts(scores, "layout", part_of)]
    if not lines:  # no room of theirs was half seen
        return
    columns = [name for name in lines[0] if name != "part"]
    rows = [[line["part"], *(shown(line[column]) for column in columns)] for line in lines]
    print_table(["part", *columns], rows)
    typer.echo("")
