"""`layoutexplore speed`: how fast the hot paths are, beside a reference timed in the same run and a goal."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.errors import ConfigError
from layoutexplore.files import check_places, write_atomically, write_json

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from layoutexplore.speed import SpeedRow


def register(app: typer.Typer) -> None:
    """Add `speed` to the command line."""
    app.command("speed", epilog="Example: layoutexplore speed --only rays --json speed.json")(speed)


def speed(
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="Measure only this (repeatable): rays, mapping, engines, ..."),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Write the figures to this file as well.")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", help="Draw how decisions slow down as the map grows to this SVG file."),
    ] = None,
) -> None:
    """Measure the speed of the kernels, the simulation and the environments.

    Prints each figure beside its reference and its goal; exits with status 1 where a goal is missed by more
    than 20 %.
    """
    from rich.console import Console

    from layoutexplore.evaluation.engines import engines
    from layoutexplore.speed import Measurement, measure, measurements

    if picture and only and "decisions" not in only:
        raise ConfigError(
            "--picture shows the measurement decisions, which was left out: add --only decisions"
        )
    check_places(None, json_file)
    check_places(None, picture, file="--picture")
    console = Console()
    rows: list[SpeedRow] = []
    more = (Measurement("engines", engines),)
    names = [measurement.name for measurement in measurements(only or (), more=more)]
    try:
        with console.status("Measuring") as status:

            def begin(name: str) -> None:
                status.update(f"Measuring {name} ({names.index(name) + 1} of {len(names)})")

            for row in measure(only or (), more=more, begin=begin):
                rows.append(row)
                if json_file:  # at once: what ends the rest may leave no time
                    write_json(json_file, {"versions": _versions(), "rows": [r.as_dict() for r in rows]})
    finally:
        if rows:
            _tell(console, rows, json_file, picture)
    if any(row.missed for row in rows):
        raise typer.Exit(1)


def _tell(console: Console, rows: list[SpeedRow], json_file: Path | None, picture: Path | None) -> None:
    """Print what was measured, and draw it where that was asked for."""
    console.print(_table(rows))
    if json_file:
        typer.echo(f"written: {json_file}")
    if picture:
        _draw(rows, picture)


def _draw(rows: list[SpeedRow], picture: Path) -> None:
    from layoutexplore.drawing.growth import draw_growth
    from layoutexplore.speed.decisions import GrowthRow

    grown = [row for row in rows if isinstance(row, GrowthRow)]
    if not grown:  # ended before they were measured
        return
    lines = {
        agent: (
            [(row.area, row.quarters[-1]) for row in grown if row.agent == agent],
            [(row.area, row.quarters[0]) for row in grown if row.agent == agent],
        )
        for agent in dict.fromkeys(row.agent for row in grown)
    }
    title = "ms a decision in the last quarter of an exploration; dashed: in the first"
    write_atomically(picture, draw_growth(lines, "floor area in square metres", title))
    typer.echo(f"written: {picture}")


def _table(rows: list[SpeedRow]) -> Table:
    from rich.table import Table

    table = Table("measurement", "ours", "reference", "ratio", "goal", "", box=None, padding=(0, 1, 0, 0))
    for index in (1, 3):
        table.columns[index].justify = "right"
    for row in rows:
        reference = "" if row.reference is None else f"{_number(row.reference)} {row.reference_name}"
        ratio = "" if row.ratio is None else f"{row.ratio:.{1 if row.ratio >= 1 else 2}f}x"
        name = f"{row.name}\n[dim]{row.note}[/dim]" if row.note else row.name
        table.add_row(name, f"{_number(row.ours)} {row.unit}", reference, ratio, row.goal, _verdict(row))
    return table


def _verdict(row: SpeedRow) -> str:
    if row.reached is None:
        return ""
    if row.missed:
        return f"[red]missed[/red] ({row.reached:.0%})"
    return "[green]met[/green]" if row.reached >= 1 else f"[yellow]nearly[/yellow] ({row.reached:.0%})"


def _number(value: float) -> str:
    """Three significant digits, without an exponent."""
    return f"{value:,.0f}".replace(",", " ") if value >= 1000 else f"{value:#.3g}".rstrip(".")


def _versions() -> dict[str, Any]:
    import cv2
    import numba
    import numpy

    import layoutexplore

    return {
        "layoutexplore": layoutexplore.__version__,
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "numba": numba.__version__,
        "opencv": cv2.__version__,
        "machine": f"{platform.machine()} {platform.processor()}".strip(),
    }
