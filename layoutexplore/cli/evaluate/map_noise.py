"""`layoutexplore evaluate map-noise`: noise of simulated maps fitted to real ones, and both told apart."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.evaluate.options import JsonFile, end_study, write_numbers
from layoutexplore.files import check_file, check_places, to_toml, write_atomically

if TYPE_CHECKING:
    from layoutexplore.grids.arrays import Floats
    from layoutexplore.training.map_noise.fit import SimulatedMaps


def map_noise(
    real: Annotated[
        list[Path], typer.Argument(help="Folders of real maps; index.csv may give file and m_per_px.")
    ],
    plans: Annotated[list[str], typer.Option(help="Floor plans to simulate maps of; repeat.")],
    count: Annotated[int, typer.Option(min=20, help="Maps to simulate.")] = 300,
    keep: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Each real map keeps a tenth of this share of them.")
    ] = 0.3,
    noise: Annotated[
        Path | None, typer.Option(help="TOML with ranges of the noise to begin with, else wide ones.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    resolution: Annotated[
        float, typer.Option(min=0.001, help="Metres a pixel where no index says it.")
    ] = 0.05,
    out: Annotated[Path | None, typer.Option(help="TOML file for the fitted ranges.")] = None,
    maps: Annotated[
        Path | None,
        typer.Option(help="Folder for maps NAME.png with rooms NAME_gt.png, of the fitted noise."),
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """How well simulated grid maps pass for real ones.

    Ten statistics, the noise fitted to real maps without truth, and the area under the ROC curve of a
    classifier of the two.
    """
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.maps.library import find_plans
    from layoutexplore.training.map_noise.files import describe_folders, read_noise, write_cases
    from layoutexplore.training.map_noise.fit import check_counts, fit_noise, simulate_maps, told_apart
    from layoutexplore.training.map_noise.simulate import WIDE

    check_places(maps, json_file)
    check_places(None, out, file="--out")
    if out is not None:
        check_file(out, suffixes=(".toml",))
    names = find_plans(plans)
    config = read_noise(noise) if noise else WIDE
    table, groups, failed = describe_folders(real, resolution)
    check_counts(len(table), count)
    progress = progress_lines()
    first = simulate_maps(names, config, count, seed=seed, progress=progress)
    fitted = fit_noise(table, first, config, keep)
    second = simulate_maps(names, fitted, count, seed=seed + 1, progress=progress)
    aucs = {"before": told_apart(table, groups, first), "fitted": told_apart(table, groups, second)}
    _print_statistics(table, {"before": first, "fitted": second})
    for name, auc in aucs.items():
        said = (
            "not tried to tell apart: it takes maps of two buildings on either side"
            if math.isnan(auc)
            else f"told apart with an area under the ROC curve of {auc:.3f} (0.5 is chance)"
        )
        typer.echo(f"{name}: {said}")
    if out is not None:
        write_atomically(out, to_toml(asdict(fitted)))
        typer.echo(f"written: {out}")
    write_numbers(json_file, {"auc": aucs, "noise": asdict(fitted), "real": len(table)})
    if maps is not None:
        written = write_cases(second, maps)
        typer.echo(f"written: {written} maps with their rooms, and buildings.csv, into {maps}")
    end_study(failed)


def _print_statistics(real: Floats, simulated: dict[str, SimulatedMaps]) -> None:
    """Deciles 1, 5 and 9 of each statistic, and how much of the real maps the simulated ones cover."""
    from layoutexplore.cli.progress import print_table
    from layoutexplore.training.map_noise.fit import covered
    from layoutexplore.training.map_noise.statistics import STATISTICS

    tables = {name: made.statistics() for name, made in simulated.items()}
    shares = {name: covered(real, table) for name, table in tables.items()}
    heading = [f"{name} {what}" for name in tables for what in ("10 / 50 / 90 %", "covers")]
    rows = []
    for k, statistic in enumerate(STATISTICS):
        cells = [_deciles(real[:, k])]
        for name, table in tables.items():
            cells += [_deciles(table[:, k]), f"{100 * shares[name][statistic]:.0f} %"]
        rows.append([statistic, *cells])
    print_table(["statistic", "real 10 / 50 / 90 %", *heading], rows)


def _deciles(values: Floats) -> str:
    import numpy as np

    return " / ".join(f"{value:.3g}" for value in np.quantile(values, [0.1, 0.5, 0.9]))
