"""`layoutexplore benchmark` and `layoutexplore report`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from layoutexplore.benchmark.config import BenchmarkConfig
    from layoutexplore.benchmark.runner import Outcome

DEFAULT_OUT = Path("benchmark-results")

BENCHMARK_HELP = """Run exploration strategies on floor plans and report who needs how many metres.

Every agent runs the same cells: floor plan, start and sensor. \
Without arguments, ten agents explore a small suite of plans in a few minutes. \
What is finished stays in the results folder: the same command continues where it was stopped.

[bold]Examples[/bold]

  layoutexplore benchmark

  layoutexplore benchmark --plans test --agents nearest --agents tour

  layoutexplore benchmark --plans ~/floors --sensor stage --sensor indoor --out results

  layoutexplore benchmark --config study.toml --out study
"""

REPORT_HELP = """Write report.html, report.md and summary.csv again from the results in a folder.

[bold]Example[/bold]

  layoutexplore report benchmark-results --baseline tour
"""


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("benchmark", help=BENCHMARK_HELP)(benchmark)
    app.command("report", help=REPORT_HELP)(report)


Plans = Annotated[
    list[str] | None,
    typer.Option(
        help="Floor plan: name, FAMILY:SEED, file, folder of plans, or quick, train, validation, test. "
        "Repeatable."
    ),
]
Explain = Annotated[
    bool | None,
    typer.Option(
        help="Also note what a layout changed and how right it was: layout agents take twice as long. "
        "Default: yes."
    ),
]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        help="TOML file with any of these options, and the tables \\[simulation] and \\[lidars.NAME]."
    ),
]


def benchmark(
    plans: Plans = None,
    starts: Annotated[int | None, typer.Option(help="Starts on each plan. Default: 2.")] = None,
    agents: Annotated[
        list[str] | None, typer.Option(help="Agent, such as tour or nearest:min_size=0.4. Repeatable.")
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option(help="Sensor: stage (default), indoor, short, mapex. Repeatable.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of starts, noise and agents. Default: 0.")] = None,
    baseline: Annotated[str | None, typer.Option(help="Agent to compare with. Default: nearest.")] = None,
    jobs: Annotated[int | None, typer.Option(help="Worker processes. Default: one per core.")] = None,
    cluster: Annotated[
        str, typer.Option(help="Run on Dask or Ray: dask, ray, dask:ADDRESS or ray:ADDRESS.")
    ] = "",
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = DEFAULT_OUT,
    config: ConfigFile = None,
    explain: Explain = None,
    force: Annotated[
        bool, typer.Option("--force", help="Delete the results in the folder and start again.")
    ] = False,
    extend: Annotated[
        bool,
        typer.Option("--extend", help="Add plans, starts, sensors or agents to the results in the folder."),
    ] = False,
) -> None:
    """Run a benchmark and write its report."""
    from rich.console import Console

    from layoutexplore.benchmark.config import BenchmarkConfig, read_benchmark_config
    from layoutexplore.errors import require

    for module in ("pandas", "pyarrow", "jinja2"):
        require(module, "bench")
    given: dict[str, Any] = {"starts": starts, "seed": seed, "baseline": baseline, "explain": explain}
    given |= {
        "plans": plans and tuple(plans),
        "agents": agents and tuple(agents),
        "sensors": sensor and tuple(sensor),
    }
    options = read_benchmark_config(config) if config else {}
    settings = BenchmarkConfig(
        **options | {name: value for name, value in given.items() if value is not None}
    )
    console = Console(highlight=False)
    outcome = run_with_progress(
        console, settings, out, jobs=jobs, cluster=cluster, force=force, extend=extend
    )
    _write_and_show(console, outcome, settings)
    if outcome.failed:
        raise typer.Exit(1)


def report(
    folder: Annotated[
        Path, typer.Argument(help="Results folder of `layoutexplore benchmark`.")
    ] = DEFAULT_OUT,
    baseline: Annotated[
        str | None, typer.Option(help="Agent to compare with. Default: as when it was run.")
    ] = None,
) -> None:
    """Write the report of a results folder again."""
    from rich.console import Console

    from layoutexplore.benchmark.analysis import agents_of
    from layoutexplore.benchmark.store import ResultsFolder
    from layoutexplore.errors import require, unknown_name
    from layoutexplore.report.benchmark import write_benchmark_report

    for module in ("pandas", "pyarrow", "jinja2"):
        require(module, "bench")
    results = ResultsFolder(folder)
    if baseline is not None and baseline not in (known := agents_of(results.rows())):
        raise unknown_name(f"agent of the results in {folder}", baseline, known)
    console = Console(highlight=False)
    for path in write_benchmark_report(results, baseline=baseline):
        console.print(f"wrote {path}", soft_wrap=True)


def run_with_progress(
    console: Console,
    settings: BenchmarkConfig,
    out: Path,
    *,
    jobs: int | None,
    cluster: str = "",
    force: bool = False,
    extend: bool = False,
) -> Outcome:
    """Run what is missing, with a line that says how far it is."""
    from layoutexplore.benchmark.pool import usable_cores
    from layoutexplore.benchmark.runner import BenchmarkProgress, BenchmarkWatcher, run_benchmark
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.processes import command_line

    try:
        with ProgressLine(console, "runs") as line:

            def advance(progress: BenchmarkProgress) -> None:
                row = progress.row
                line.advance(
                    progress.done, progress.total, progress.work_done, f"{row.plan} {row.sensor} {row.agent}"
                )

            return run_benchmark(
                settings,
                out,
                jobs=usable_cores() if jobs is None else jobs,
                cluster=cluster,
                force=force,
                extend=extend,
                command=command_line(),
                watcher=BenchmarkWatcher(line.say, advance),
            )
    except KeyboardInterrupt:
        console.print(f"\nStopped. What is finished is in {out}: the same command continues.", soft_wrap=True)
        raise typer.Exit(130) from None


def _write_and_show(console: Console, outcome: Outcome, config: BenchmarkConfig) -> None:
    from layoutexplore.benchmark.analysis import compare
    from layoutexplore.report.benchmark import headline, write_benchmark_report

    comparisons = compare(outcome.rows, config.baseline)
    paths = write_benchmark_report(outcome.folder, baseline=config.baseline, comparisons=comparisons)
    console.print()
    console.print(_table(headline(outcome.rows, config.baseline, comparisons)))
    if not any(row.agent == config.baseline for row in outcome.rows):
        console.print(
            f"{config.baseline} did not run, so nothing is compared: --baseline names another, --extend "
            "adds agents",
            soft_wrap=True,
        )
    for row in outcome.failed[:5]:
        console.print(
            f"failed: {row.plan}, start {row.start}, {row.sensor}, {row.agent}: {row.error}", soft_wrap=True
        )
    if len(outcome.failed) > 5:
        console.print(f"... and {len(outcome.failed) - 5} more failed runs, see the report")
    console.print(f"{len(outcome.rows)} runs, {outcome.ran} of them now. Report: {paths[0]}", soft_wrap=True)


def _table(rows: list[tuple[str, ...]]) -> Any:
    from rich.table import Table

    table = Table(box=None, header_style="bold", pad_edge=False)
    for k, name in enumerate(rows[0]):
        table.add_column(name, justify="left" if k == 0 else "right", no_wrap=True)
    for row in rows[1:]:
        table.add_row(*row)
    return table
