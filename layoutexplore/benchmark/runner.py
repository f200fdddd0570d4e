"""Runs a benchmark: every agent on every (floor plan, start, sensor), on workers, into a results folder."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2

import layoutexplore
from layoutexplore.agents import make_agent
from layoutexplore.benchmark.cluster import RUNS_CODE, check_cluster, run_on_cluster
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.counterfactual import CounterfactualRollouts
from layoutexplore.benchmark.failures import (
    at_length,
    described,
    finished_rows,
    lacks_memory,
    repeating_command,
)
from layoutexplore.benchmark.manifest import mixed_code
from layoutexplore.benchmark.plans import (
    PlanEntry,
    Task,
    all_tasks,
    check_names,
    check_poses,
    entry,
    start_of,
    warm_up_plan,
)
from layoutexplore.benchmark.pool import Limited, run_all, taken_megabytes
from layoutexplore.benchmark.recording import Recorder
from layoutexplore.benchmark.rows import Row, fingerprints, has_own_code, prepare, score_run
from layoutexplore.benchmark.store import ResultsFolder, locked, open_results
from layoutexplore.drawing.beliefs import SUFFIX, BeliefNotes
from layoutexplore.errors import ConfigError, WriteError, checks_arguments, counted
from layoutexplore.grids.arrays import shows_shapes
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.library import cached_plan, find_plans
from layoutexplore.options import JOBS, check_kind
from layoutexplore.plugins.transport import NO_CODE, OwnCode, pack_own_code
from layoutexplore.processes import asked_to_stop
from layoutexplore.processes.kernel_list import LARGE_MAP, compile_before, uses_of_runs
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play, run_seed
from layoutexplore.simulation.state import is_large, raster_of

MOST_RUNS = 1_000_000
"""So many runs a benchmark may have: the list of them must fit into memory."""


@dataclass(frozen=True)
class BenchmarkProgress:
    """How far a benchmark is.

    Attributes:
        row: The run that has just ended.
        done: Number of runs that have ended, those of earlier calls included.
        total: Number of all runs.
        work_done: Share of the work of this call that is done, 0..1, by the area that there is to explore.
    """

    row: Row
    done: int
    total: int
    work_done: float


class BenchmarkWatcher(NamedTuple):
    """What is told how far a benchmark is.

    Attributes:
        say: Told what happens before the first run.
        advance: Told when a run has ended.
        compiled: Told how many kernels of how many have been compiled, where several processes do so.
    """

    say: Callable[[str], None] = lambda text: None
    advance: Callable[[BenchmarkProgress], None] = lambda progress: None
    compiled: Callable[[int, int], None] = lambda done, total: None


WATCHED_BY_NOBODY = BenchmarkWatcher()


@shows_shapes
@dataclass(frozen=True)
class Outcome:
    """What a benchmark leaves.

    Attributes:
        folder: The results.
        rows: All rows, sorted.
        ran: How many of them were run now.
        asked: Those of the plans, starts, sensors and agents of this call.
        warnings: What should be known of the runs that were made now.
    """

    folder: ResultsFolder
    rows: list[Row]
    ran: int
    asked: list[Row]
    warnings: list[str]

    @property
    def failed(self) -> list[Row]:
        """Runs of this call that ended in an error."""
        return [row for row in self.asked if row.error]


@checks_arguments
def run_benchmark(
    config: BenchmarkConfig,
    out: str | os.PathLike[str],
    *,
    jobs: int = 1,
    cluster: str = "",
    force: bool = False,
    extend: bool = False,
    command: str = "",
    watcher: BenchmarkWatcher = WATCHED_BY_NOBODY,
) -> Outcome:
    """Run what is missing of a benchmark, and write results.csv and the curves.

    Args:
        config: What to run.
        out: The results folder; finished runs in it are kept.
        jobs: Worker processes.
        cluster: A Dask or Ray cluster instead of local processes, see `layoutexplore.benchmark.cluster`.
        force: Delete another benchmark's results in `out` first.
        extend: Add to a benchmark with the same settings.
        command: Noted in the folder.
        watcher: Told how far it is.

    Raises:
        LayoutExploreError: A plan cannot be read, a name is unknown, the folder holds another configuration.
            A run that fails raises nothing: its row says what went wrong. (With one job, own code that ends
            its process ends this one.)
    """
    out = Path(out)
    check_kind("config", config, BenchmarkConfig)
    JOBS.convert("--jobs", jobs)
    if cluster:
        check_cluster(cluster)
    if config.baseline:
        make_agent(config.baseline)
    models = fingerprints(config.agents)  # An unknown name or parameter is better told now than in every run.
    code = pack_own_code(registered=_apart(config, jobs, cluster))
    plans = _loaded(config, 1 if cluster else jobs, bool(models), watcher)
    with locked(out):
        folder = open_results(out, config, plans, models, force=force, extend=extend, command=command)
        manifest = folder.manifest()
        for text in mixed_code(manifest):
            watcher.say(text)
        if manifest["baseline"] not in manifest["agents"]:
            watcher.say(
                f"the baseline {manifest['baseline']} is not among the agents, so nothing will be compared: "
                "--agents adds it, --baseline names another"
            )
        for plan in plans:
            folder.save_raster(plan.name, raster_of(cached_plan(plan.source), config.simulation))
        return _fill(folder, config, plans, code, jobs, cluster, watcher)


def _apart(config: BenchmarkConfig, jobs: int, cluster: str) -> bool:
    """Whether runs are made by other processes than this one."""
    return jobs > 1 or config.cell_mb > 0 or bool(cluster)


def _fill(
    folder: ResultsFolder,
    config: BenchmarkConfig,
    plans: list[PlanEntry],
    code: OwnCode,
    jobs: int,
    cluster: str,
    watcher: BenchmarkWatcher,
) -> Outcome:
    """Make the runs that are missing in the folder."""
    tasks = all_tasks(config, plans)
    keys = {task.key for task in tasks}
    rows = {row.key: row for row in finished_rows(folder, watcher.say, keys)}
    missing = [task for task in tasks if task.key not in rows]
    if len(missing) < len(tasks):
        watcher.say(f"{len(tasks) - len(missing)} of {len(tasks)} runs are already in {folder.path}")
    if missing:
        watcher.say("compiling and loading the kernels (slow only the first time)")
        apart = _apart(config, jobs, cluster) or config.cell_seconds > 0
        warm_up(config, code, 1 if cluster else jobs, apart, watcher.say)
        if ":" in cluster:
            watcher.say(RUNS_CODE)
        watcher.say(f"exploring: {counted(len(missing), 'run')}" + f", {jobs} at a time" * (jobs > 1))
    work = sum(task.plan.reachable_area for task in missing)
    areas, done = {plan.name: plan.reachable_area for plan in plans}, 0.0
    unasked: set[str] = set()
    try:
        with folder.appending() as append:
            results = _results(config, folder, missing, code, jobs, cluster)
            for count, row in enumerate(results, len(tasks) - len(missing) + 1):
                append(row)
                rows[row.key] = row
                done += areas[row.plan]
                if config.explain and not row.error and row.layout_changed != row.layout_changed:
                    unasked.add(row.agent)
                watcher.advance(BenchmarkProgress(row, count, len(tasks), done / work))
    finally:
        folder.rewrite(rows.values())
    everything = sorted(rows.values(), key=lambda row: row.key)
    asked = [row for row in everything if row.key in keys]
    return Outcome(folder, everything, len(missing), asked, [_UNASKED.format(a) for a in sorted(unasked)])


_UNASKED = (
    "{}: of some runs it is not noted what a layout changed, since the agent cannot be copied, or fails "
    "without its layout or with another one; the runs themselves are as ever (--no-explain does not ask)"
)


def warm_up(
    config: BenchmarkConfig, code: OwnCode, jobs: int, apart: bool, say: Callable[[str], None]
) -> None:
    """A few decisions of every agent and sensor on a tiny plan: kernels are compiled, or loaded.

    Args:
        config: Of the benchmark.
        code: Of the user's own.
        jobs: Processes that share the work; with one, it is this one.
        apart: Leave own code to its runs, which have limits, and to other processes, which it may end.
        say: Told of each agent of own code before it decides: one that never does is known by its name.
    """
    with code.installed():
        own = [agent for agent in config.agents if has_own_code(agent)]
    cells = [(s, a) for s in config.sensors for a in config.agents if not (apart and a in own)]
    if jobs > 1:
        list(run_all(functools.partial(_warm_up, config=config, code=code), cells, jobs=jobs, lost=bool))
        return
    for cell in cells:
        if cell[1] in own:
            say(f"first decisions of {cell[1]} on a tiny floor")
        _warm_up(cell, config, code)


_warm: set[int] = set()
"""Hashes of what this process has warmed up for."""


def _warm_up_for(task: Task, config: BenchmarkConfig, code: OwnCode) -> None:
    """As `warm_up`, of one task alone: a worker in a dead one's place begins soon."""
    with contextlib.suppress(Exception, SystemExit):  # the run fails in the same way
        cached_plan(task.plan.source)
    _warm_up((task.sensor, task.agent), config, code)


def _warm_up(cell: tuple[str, str], config: BenchmarkConfig, code: OwnCode) -> None:
    cv2.setNumThreads(1)
    # An agent that fails here fails again in its runs, where the failure is recorded.
    with contextlib.suppress(Exception, SystemExit), code.installed():
        simulation = config.simulation_with(cell[0])
        probe = CounterfactualRollouts if config.explain else None
        done = hash((repr(simulation), cell[1], config.explain, has_own_code(cell[1]) and repr(code)))
        if done not in _warm:
            _warm.add(done)
            play(*prepare(warm_up_plan(), simulation, cell[1]), probe=probe)


def run_task(task: Task, config: BenchmarkConfig, folder: ResultsFolder, code: OwnCode = NO_CODE) -> Row:
    """Make one run, keep its curve, and return its row; a failure becomes the row's error."""
    row, taken = _empty_row(task, config), taken_megabytes()
    repeat = "the same command"
    try:
        plan = cached_plan(task.plan.source)
        conditions = settings, seed, start = _conditions(task, config)
        repeat = repeating_command(task.plan.source, task.agent, task.sensor, *conditions, folder.path)
        recorder, beliefs = Recorder(with_rooms=config.explain), BeliefNotes()
        with code.installed():
            simulation, agent = prepare(plan, settings, task.agent)
            simulation.on_scan = recorder.note_scan
            episode = play(
                simulation,
                agent,
                seed=seed,
                start=start,
                on_step=beliefs.noting_after(recorder.note_decision),
                probe=CounterfactualRollouts if config.explain else None,
            )
        episode = dataclasses.replace(episode, seconds=episode.seconds - recorder.seconds - beliefs.seconds)
        scored = score_run(row, simulation, episode)
        beliefs.save(folder.curve_path(scored).with_suffix(SUFFIX))
        folder.save_episode(scored, episode, recorder.end())
        return scored
    except WriteError:
        raise  # a full disk is no failure of the agent
    except (Exception, SystemExit) as error:
        if asked_to_stop():  # compiled code turns the interruption into another error
            raise KeyboardInterrupt from error
        if config.cell_mb and lacks_memory(error):
            error.add_note(beyond := _beyond_memory(config, taken))
            message = f"CellMemoryError: {beyond}"
        else:
            message = described(error)
        folder.save_failure(row, at_length(error, repeat))
        return dataclasses.replace(row, error=message)


def _beyond_memory(config: BenchmarkConfig, taken: float) -> str:
    """What is said of a run that its limit of memory ended."""
    return (
        f"the run took more than the {config.cell_mb:g} MB (cell_mb) that it may "
        f"beside the {taken:.0f} MB that its process has before it begins: "
        "allow more, or 0 for any"
    )


def uses_of(config: BenchmarkConfig, predicts: bool) -> set[str]:
    """What a benchmark needs of what the list of kernels knows."""
    return uses_of_runs(config.agents, config.sensors, predicts=predicts)


def _loaded(config: BenchmarkConfig, jobs: int, predicts: bool, watcher: BenchmarkWatcher) -> list[PlanEntry]:
    """The floor plans; what reads and explores them is compiled, too, if several processes can."""
    sources = find_plans(config.plans)
    count = len(sources) * config.starts * len(config.sensors) * len(config.agents)
    if count > MOST_RUNS:
        raise ConfigError(f"{count} runs are more than {MOST_RUNS}: give fewer plans, starts or agents")
    compile_before(uses_of(config, predicts), jobs, watcher.say, watcher.compiled)
    watcher.say(f"reading {counted(len(sources), 'floor plan')}")
    plans, large = list[PlanEntry](), False
    for source in sources:
        plans.append(entry(source, config.simulation))
        large = large or is_large(cached_plan(source), config.simulation)
    compile_before([LARGE_MAP] * large, jobs, watcher.say, watcher.compiled)
    check_names(plans)
    check_poses(config, plans)
    return plans


def _results(
    config: BenchmarkConfig, folder: ResultsFolder, tasks: list[Task], code: OwnCode, jobs: int, cluster: str
) -> Iterator[Row]:
    run = functools.partial(run_task, config=config, folder=folder, code=code)
    killed = (
        f"WorkerDied: the process of this run ended {config.tries} times, by a crash or an exit of the "
        "agent's own code, or killed (out of memory?)"
    )
    if config.cell_mb:
        killed += f"; if it was memory, {_beyond_memory(config, taken_megabytes())}"
    late = f"CellTimeoutError: the run took longer than the {config.cell_seconds:g} s that it may"
    lost = functools.partial(_failed_row, config=config, folder=folder, message=killed)
    too_late = functools.partial(_failed_row, config=config, folder=folder, message=late)
    warm = functools.partial(_warm_up_for, config=config, code=code)
    function = Limited(run, too_late, config.cell_seconds, config.cell_mb, warm)
    if cluster:
        return run_on_cluster(function, tasks, cluster=cluster, jobs=jobs, lost=lost, tries=config.tries)
    return run_all(
        function,
        tasks,
        jobs=jobs,
        lost=lost,
        begin=functools.partial(cv2.setNumThreads, 1),
        tries=config.tries,
        apart=config.cell_mb > 0,  # compiled code for which no memory is left ends its process
    )


def _empty_row(task: Task, config: BenchmarkConfig) -> Row:
    return Row(
        plan=task.plan.name,
        start=task.start,
        sensor=task.sensor,
        agent=task.agent,
        seed=config.seed,
        building=task.plan.building,
        version=layoutexplore.__version__,
        config_hash=config.config_hash,
    )


def _failed_row(task: Task, config: BenchmarkConfig, folder: ResultsFolder, message: str) -> Row:
    """The row of a run that did not come to its end; the command that repeats it is kept beside it."""
    row = dataclasses.replace(_empty_row(task, config), error=message)
    conditions = _conditions(task, config)
    repeat = repeating_command(task.plan.source, task.agent, task.sensor, *conditions, folder.path)
    folder.save_failure(row, f"{message}\nRepeat it: {repeat}\n")
    return row


def _conditions(task: Task, config: BenchmarkConfig) -> tuple[SimulationConfig, int, Pose]:
    """How a run is simulated, its seed and its start."""
    seed = run_seed(config.seed, task.plan.name, task.start)
    return config.simulation_with(task.sensor), seed, start_of(config, task.plan, task.start)
