"""`layoutexplore benchmark` and `layoutexplore report`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.cli.explore import NoiseLevel

if TYPE_CHECKING:
    from rich.console import Console

    from layoutexplore.benchmark.config import BenchmarkConfig
    from layoutexplore.benchmark.rows import Row
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

  layoutexplore benchmark --suite v1 --agents tour --out tour-v1
"""

REPORT_HELP = """Write report.html, report.md and summary.csv again from the results in a folder.

[bold]Example[/bold]

  layoutexplore report benchmark-results --baseline tour
"""


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("benchmark", help=BENCHMARK_HELP)(benchmark)
    app.command("report", help=REPORT_HELP)(report)


_LEAST_NAME = 12
"""Characters of an agent's name on a line of the table that is printed, at least."""

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
        help="TOML file of plans, starts, agents, sensors, seed, baseline, explain and limits of a run, and "
        "the tables \\[simulation] (noise, for one), \\[lidars.NAME], \\[poses]. Options here come first."
    ),
]


Starts = Annotated[int | None, typer.Option(help="Starts on each plan. Default: 2.")]
Agents = Annotated[
    list[str] | None, typer.Option(help="Agent, such as tour or nearest:min_size=0.4. Repeatable.")
]
Sensors = Annotated[
    list[str] | None, typer.Option(help="Sensor: stage (default), indoor, short, mapex. Repeatable.")
]
Seed = Annotated[int | None, typer.Option(help="Seed of starts, noise and agents. Default: 0.")]
Baseline = Annotated[str | None, typer.Option(help="Agent to compare with. Default: nearest.")]
Jobs = Annotated[int | None, typer.Option(help="Worker processes. Default: one per core.")]
Cluster = Annotated[str, typer.Option(help="Run on Dask or Ray: dask, ray, dask:ADDRESS or ray:ADDRESS.")]
Out = Annotated[Path, typer.Option(help="Folder of the results.")]
Suite = Annotated[
    str,
    typer.Option(
        help="Fixed cells that all can compare on: v1, or a TOML file. Only agents are yours to choose."
    ),
]
CellSeconds = Annotated[float | None, typer.Option(help="A run that takes longer fails. Default: any time.")]
CellMb = Annotated[
    float | None, typer.Option(help="So does a run that takes more memory [MB]. Default: any.")
]
Tries = Annotated[int | None, typer.Option(help="Make a run whose worker is killed so often. Default: 3.")]
Force = Annotated[bool, typer.Option("--force", help="Delete the results in the folder and start again.")]
Extend = Annotated[
    bool, typer.Option("--extend", help="Add plans, starts, sensors or agents to the results in the folder.")
]
Again = Annotated[
    list[str] | None,
    typer.Option(help="Delete the runs of this agent and make them anew, others' stay. Repeatable."),
]


def benchmark(
    plans: Plans = None,
    starts: Starts = None,
    agents: Agents = None,
    sensor: Sensors = None,
    noise: NoiseLevel = "",
    seed: Seed = None,
    baseline: Baseline = None,
    jobs: Jobs = None,
    cluster: Cluster = "",
    out: Out = DEFAULT_OUT,
    config: ConfigFile = None,
    suite: Suite = "",
    explain: Explain = None,
    cell_seconds: CellSeconds = None,
    cell_mb: CellMb = None,
    tries: Tries = None,
    force: Force = False,
    extend: Extend = False,
    again: Again = None,
) -> None:
    """Run a benchmark and write its report."""
    from layoutexplore.cli.progress import plain_console

    _require_extra()
    given: dict[str, Any] = {"starts": starts, "seed": seed, "baseline": baseline, "explain": explain}
    lists = {"plans": plans, "agents": agents, "sensors": sensor}
    given |= {name: values and tuple(values) for name, values in lists.items()}
    limits = {"cell_seconds": cell_seconds, "cell_mb": cell_mb, "tries": tries, "again": again}
    settings = _settings(config, suite, noise, given, limits)
    console = plain_console()
    outcome = run_with_progress(
        console, settings, out, jobs=jobs, cluster=cluster, force=force, extend=extend
    )
    _write_and_show(console, outcome)
    if outcome.failed:
        raise typer.Exit(1)


def _require_extra() -> None:
    """Raise the error that names the extra where tables cannot be made or written."""
    from layoutexplore.errors import require

    for module in ("pandas", "pyarrow", "jinja2"):
        require(module, "bench")


def _settings(
    config: Path | None, suite: str, noise: str, given: dict[str, Any], limits: dict[str, Any]
) -> BenchmarkConfig:
    """What is run: the file's options, those given above them, None for what was not; limits in any case."""
    from layoutexplore.benchmark.config import QUICK_AGENTS, BenchmarkConfig, read_benchmark_config
    from layoutexplore.benchmark.suite import load_suite
    from layoutexplore.errors import ConfigError
    from layoutexplore.files import blaming
    from layoutexplore.simulation.config import SimulationConfig

    of_file = read_benchmark_config(config) if config else {}
    options = of_file | {name: value for name, value in given.items() if value is not None}
    if noise:
        simulation = options.get("simulation", SimulationConfig())
        options["simulation"] = dataclasses.replace(simulation, noise=noise)
    with blaming(config, ConfigError, lambda: BenchmarkConfig(**of_file)):
        if suite:
            settings = load_suite(suite).config(tuple(options.pop("agents", QUICK_AGENTS)), **options)
        else:
            settings = BenchmarkConfig(**options)
    return dataclasses.replace(settings, **{k: v for k, v in limits.items() if v is not None})


def report(
    folder: Annotated[
        Path, typer.Argument(help="Results folder of `layoutexplore benchmark`.")
    ] = DEFAULT_OUT,
    baseline: Annotated[
        str | None, typer.Option(help="Agent to compare with. Default: as when it was run.")
    ] = None,
    paper: Annotated[
        bool,
        typer.Option("--paper", help="Every chart as SVG and PDF, every table as LaTeX and CSV, in paper/."),
    ] = False,
) -> None:
    """Write the report of a results folder again."""
    from layoutexplore.benchmark.analysis import agents_of
    from layoutexplore.benchmark.store import ResultsFolder
    from layoutexplore.cli.progress import plain_console
    from layoutexplore.errors import unknown_name
    from layoutexplore.report.benchmark import write_benchmark_report

    _require_extra()
    results = ResultsFolder(folder)
    if baseline is not None and baseline not in (known := agents_of(results.rows())):
        raise unknown_name(f"agent of the results in {folder}", baseline, known)
    console = plain_console()
    written = write_benchmark_report(results, baseline=baseline)
    if paper:
        from layoutexplore.report.paper import write_paper

        written += write_paper(results, results.path / "paper", baseline=baseline)
    for path in written:
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
    from layoutexplore.benchmark.runner import BenchmarkProgress, BenchmarkWatcher, run_benchmark
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.processes import asked_to_stop, command_line, usable_cores

    try:
        with ProgressLine(console, "runs") as line, ProgressLine(console, "kernels") as kernels:

            def say(text: str) -> None:
                line.say(text)
                kernels.restart()  # they are compiled twice, where a floor plan is large

            def compiled(done: int, total: int) -> None:
                kernels.advance(done, total, done / total)
                if done == total:
                    kernels.end()

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
                watcher=BenchmarkWatcher(say, advance, compiled),
            )
    except KeyboardInterrupt:
        without = " without --again" if settings.again else ""
        text = f"\nStopped. What is finished is in {out}: the same command{without} continues."
        console.print(text, soft_wrap=True)
        raise typer.Exit(128 + (asked_to_stop() or 2)) from None


def run_shared(config: BenchmarkConfig, folder: Path, jobs: int | None) -> list[Row]:
    """Make the runs that a folder lacks, to which others may add as well; those that fail are named."""
    from layoutexplore.cli.progress import plain_console

    outcome = run_with_progress(plain_console(), config, folder, jobs=jobs, extend=True)
    for row in outcome.asked:
        if row.error:
            typer.echo(f"failed: {row.plan} {row.sensor} {row.agent}: {row.error}")
    return outcome.asked


def _write_and_show(console: Console, outcome: Outcome) -> None:
    from layoutexplore.benchmark.analysis import compare
    from layoutexplore.errors import counted
    from layoutexplore.report.benchmark import headline, write_benchmark_report

    baseline = str(outcome.folder.manifest()["baseline"])
    comparisons = compare(outcome.rows, baseline)
    paths = write_benchmark_report(outcome.folder, baseline=baseline, comparisons=comparisons)
    console.print()
    console.print(_table(headline(outcome.rows, baseline, comparisons), console.width))
    if not any(row.agent == baseline for row in outcome.rows):
        console.print(
            f"{baseline} did not run, so nothing is compared: --baseline names another, --extend adds agents",
            soft_wrap=True,
        )
    for text in outcome.warnings:
        console.print(text, soft_wrap=True, markup=False)
    for row in outcome.failed[:5]:
        console.print(
            f"failed: {row.plan}, start {row.start}, {row.sensor}, {row.agent}: {row.error}",
            soft_wrap=True,
            markup=False,
        )
        console.print(outcome.folder.failure(row), soft_wrap=True, markup=False)
    if len(outcome.failed) > 5:
        console.print(f"... and {len(outcome.failed) - 5} more failed runs, see the report")
    runs = counted(len(outcome.rows), "run")
    console.print(f"{runs}, {outcome.ran} of them now. Report: {paths[0]}", soft_wrap=True)


def _table(rows: list[tuple[str, ...]], width: int) -> Any:
    """The table, without its last columns where the terminal has no room for them: the report has all."""
    from rich.table import Table

    table = Table(box=None, header_style="bold", pad_edge=False)
    # Long names of agents are folded; numbers and what stands above them never are.
    table.add_column(rows[0][0], overflow="fold", min_width=_LEAST_NAME)
    left = width - _LEAST_NAME
    kept = 1
    for column in list(zip(*rows, strict=True))[1:]:
        wide = max(map(len, column))
        left -= wide + 2
        if left < 0:
            break
        table.add_column(column[0], justify="right", no_wrap=True, min_width=wide)
        kept += 1
    for row in rows[1:]:
        table.add_row(*row[:kept])
    return table
