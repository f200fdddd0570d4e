"""Agents of a user's own in the benchmark: named, as objects, on workers; changed, and failing."""

from __future__ import annotations

import dataclasses
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore.benchmark import pool
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import prepare
from layoutexplore.benchmark.runner import BenchmarkWatcher, run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.cli import app
from layoutexplore.errors import OwnCodeError, ResultsError
from layoutexplore.frontiers.decision import STOP, Decision
from layoutexplore.maps.library import load_plan
from layoutexplore.simulation.config import SimulationConfig
from tests.benchmark.cases import timeless
from tests.plugins.cases import AGENT, write

FAILING = AGENT.replace(
    "return min(",
    "if decision.step == 2:\n"
    "            raise RuntimeError(f'{decision.pose.x:.9f} {decision.distance:.9f}')\n"
    "        return min(",
)
ROOMS = """
import numpy as np
class Mine:
    def __init__(self, width: int = 3):
        self.width = width
    def rooms(self, decision):
        return np.where(decision.grid.cells == 0, 1, 0)
"""
METHOD = "def mine(grid, room: int = 1):\n    return (grid.cells == 0) * room\n"


class First:
    """The first frontier."""

    def reset(self, seed: int) -> None: ...

    def act(self, decision: Decision) -> int:
        return 0 if decision.frontiers else STOP


def config(plans: Path, *agents: object, simulation: SimulationConfig | None = None) -> BenchmarkConfig:
    return BenchmarkConfig(
        plans=(str(plans / "cottage.geojson"),),
        starts=1,
        agents=["nearest:min_size=0", *agents],
        baseline="nearest:min_size=0",
        simulation=simulation or SimulationConfig(),
        explain=False,
    )


def test_an_own_agent_runs_here_and_on_workers(plans: Path, tmp_path: Path) -> None:
    wanted = config(plans, f"{write(tmp_path)}:Mine", First, f"{write(tmp_path)}:Mine:skip=1")
    assert wanted.agents[2] == "First"
    here, there = (run_benchmark(wanted, tmp_path / str(jobs), jobs=jobs) for jobs in (1, 2))
    assert timeless(here.rows) == timeless(there.rows) and not here.failed
    nearest, first, mine, skipping = (
        next(r for r in here.rows if r.agent == name)
        for name in sorted(wanted.agents, key=wanted.agents.index)
    )
    assert nearest.distance == pytest.approx(mine.distance) == pytest.approx(first.distance)
    assert skipping.distance > 0


def test_changed_code_is_another_configuration(plans: Path, tmp_path: Path) -> None:
    wanted = config(plans, f"{write(tmp_path)}:Mine")
    run_benchmark(wanted, tmp_path / "out")
    assert run_benchmark(wanted, tmp_path / "out").ran == 0
    write(tmp_path, AGENT.replace("STEP = 0", "STEP = 1"))
    with pytest.raises(ResultsError, match="holds the results of another configuration"):
        run_benchmark(wanted, tmp_path / "out")
    assert run_benchmark(wanted, tmp_path / "out", force=True).ran == 2


@pytest.mark.parametrize(
    ("text", "spec"),
    [(ROOMS, "{}:Mine"), (METHOD, "reconstruct:{}:mine"), (METHOD, "reconstruct:{}:mine;room=2")],
)
def test_own_rooms_count_too(plans: Path, tmp_path: Path, text: str, spec: str) -> None:
    agent = f"layout-tour:predictor={spec.format(write(tmp_path, text))}"
    done = run_benchmark(config(plans, agent), tmp_path / "out")
    assert not done.failed and done.rows[0].prediction_seconds > 0
    write(tmp_path, text + "\n")
    with pytest.raises(ResultsError, match=r"settings\.models"):
        run_benchmark(config(plans, agent), tmp_path / "out")


@pytest.mark.parametrize("simulation", [SimulationConfig(), SimulationConfig(turn_cost=0.5, resolution=0.2)])
def test_a_crash_names_the_command_that_repeats_it(
    plans: Path, tmp_path: Path, simulation: SimulationConfig
) -> None:
    path = write(tmp_path, FAILING)
    done = run_benchmark(config(plans, f"{path}:Mine:skip=1", simulation=simulation), tmp_path / "out")
    (row,) = done.failed
    assert row.error.startswith("RuntimeError") and row.error.endswith("(mine.py, line 16)")
    trace, _, command = done.folder.failure(row).partition("Repeat it: ")
    assert f'File "{path}", line 16, in act' in trace and "runner" not in trace
    result = CliRunner().invoke(app, shlex.split(command)[1:])
    assert isinstance(result.exception, RuntimeError) and str(result.exception) in trace


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is limited on Linux alone")
@pytest.mark.parametrize(
    ("grasp", "said", "begun"),
    [
        (
            "__import__('numpy').zeros(2**29)",
            "CellMemoryError: the run took more than the 200 MB (cell_mb)",
            1,
        ),
        (
            "__import__('os')._exit(1)",
            "WorkerDied: the process of this run ended 2 times, by a crash or an exit of",
            3,
        ),
    ],
)
def test_a_run_beyond_its_memory_says_how_much_it_may_take(
    plans: Path, tmp_path: Path, grasp: str, said: str, begun: int
) -> None:
    """One whose process dies is begun once among others, and alone as often as it may."""
    mark = tmp_path / "begun"
    lines = [
        "import resource",
        "        limit, _ = resource.getrlimit(resource.RLIMIT_AS)",
        "        if decision.step == 2 and limit != resource.RLIM_INFINITY:  # not while it is warmed up",
        f"            open({str(mark)!r}, 'a').write('x')",
        f"            {grasp}",
        "        return min(",
    ]
    path = write(tmp_path, AGENT.replace("return min(", "\n".join(lines)))
    limited = dataclasses.replace(config(plans, f"{path}:Mine"), cell_mb=200, cell_seconds=60, tries=2)
    done = run_benchmark(limited, tmp_path / "out")
    (row,) = done.failed
    assert row.error.startswith(said) and mark.read_text() == "x" * begun
    assert re.search(r"beside the \d{3,} MB that its process has before it begins: allow more", row.error)


def test_an_agent_without_end_ends_with_its_time(
    plans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its warm-up, too: it has the same endless loop."""
    monkeypatch.setattr(pool, "PREPARING", 0.0)
    path = write(tmp_path, AGENT.replace("return min(", "while True:\n            pass\n        return min("))
    done = run_benchmark(dataclasses.replace(config(plans, f"{path}:Mine"), cell_seconds=2), tmp_path / "out")
    (row,) = done.failed
    assert row.error.startswith("CellTimeoutError: the run took longer than the 2 s that it may")


@pytest.mark.parametrize("error", ["__import__('asyncio').CancelledError", "GeneratorExit", "SystemExit"])
def test_what_is_no_exception_fails_one_run_alone(plans: Path, tmp_path: Path, error: str) -> None:
    path = write(
        tmp_path, FAILING.replace("RuntimeError(f'{decision.pose.x:.9f} {decision.distance:.9f}')", error)
    )
    done = run_benchmark(config(plans, f"{path}:Mine"), tmp_path / "out")
    (row,) = done.failed
    assert len(done.rows) == 2 and error.rpartition(".")[2] in row.error


def test_a_repaired_run_has_no_failure(plans: Path, tmp_path: Path) -> None:
    path = write(tmp_path, FAILING)
    done = run_benchmark(config(plans, f"{path}:Mine"), tmp_path / "out")
    assert done.folder.failure(done.failed[0])
    write(tmp_path)
    again = run_benchmark(config(plans, f"{path}:Mine"), tmp_path / "out", force=True)
    assert not again.failed and not list((tmp_path / "out").rglob("*.error.txt"))


@pytest.mark.parametrize("moment", ["said", "compiling", "exploring"])
def test_a_file_that_is_edited_changes_nothing_in_a_run(plans: Path, tmp_path: Path, moment: str) -> None:
    lazy = AGENT.replace("return min(", f"from {moment}_step import STEP\n        return min(STEP + ")
    write(tmp_path, "STEP = 1", f"{moment}_step.py")
    path = write(tmp_path, lazy)
    wanted = config(plans, f"{path}:Mine")
    whole = run_benchmark(wanted, tmp_path / "whole")

    def edit(text: str) -> None:
        if text.startswith(moment) or moment == "said":
            write(tmp_path, FAILING)
            write(tmp_path, "STEP = 0 / 0", f"{moment}_step.py")

    for jobs in (1, 2):
        write(tmp_path, lazy)
        write(tmp_path, "STEP = 1", f"{moment}_step.py")
        out = tmp_path / str(jobs)
        edited = run_benchmark(wanted, out, jobs=jobs, watcher=BenchmarkWatcher(say=edit))
        assert not edited.failed and timeless(edited.rows) == timeless(whole.rows)
    with pytest.raises(ResultsError, match="another configuration"):
        run_benchmark(wanted, out)


def test_an_agent_that_ends_the_program_fails_alone(plans: Path, tmp_path: Path) -> None:
    path = write(tmp_path, AGENT.replace("return min(", "__import__('sys').exit('bye')\n        return min("))
    for jobs in (1, 2):
        done = run_benchmark(config(plans, f"{path}:Mine"), tmp_path / str(jobs), jobs=jobs)
        assert [row.error for row in done.failed] == ["SystemExit: bye (mine.py, line 15)"]
        assert len(done.rows) == 2
    path = write(tmp_path, AGENT.replace("self.skip = skip", "raise SystemExit('bye')"))
    with pytest.raises(OwnCodeError, match="bye"):
        run_benchmark(config(plans, f"{path}:Mine"), tmp_path / "out")


@pytest.mark.parametrize("spec", ["{}:Mine", "layout-tour:predictor={}:Mine"])
def test_code_that_ends_its_process_from_the_beginning_costs_its_own_runs(
    plans: Path, tmp_path: Path, spec: str
) -> None:
    """In a process of its own: it would end this one."""
    ending = AGENT.replace("return min(", "__import__('os')._exit(3)\n        return min(")
    text = ending if spec.startswith("{") else ROOMS.replace("return np", "__import__('os')._exit(3)\n    #")
    agent = spec.format(write(tmp_path, text))
    words = ["benchmark", "--plans", str(plans / "cottage.geojson"), "--starts", "1", "--tries", "1"]
    words += ["--agents", "nearest", "--agents", agent, "--out", str(tmp_path / "out"), "--jobs", "2"]
    done = subprocess.run([sys.executable, "-m", "layoutexplore", *words], capture_output=True, check=False)
    assert done.returncode == 1, done.stderr
    errors = {row.agent: row.error for row in ResultsFolder(tmp_path / "out").rows()}
    assert not errors["nearest"] and errors[agent].startswith("WorkerDied")


def test_code_that_cannot_be_loaded_is_told_before_anything_runs(plans: Path, tmp_path: Path) -> None:
    with pytest.raises(OwnCodeError, match="SyntaxError"):
        run_benchmark(config(plans, f"{write(tmp_path, 'class Mine')}:Mine"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_program_s_own_classes_travel_to_workers(plans: Path, tmp_path: Path) -> None:
    """A class of the program itself, as of a notebook: no worker could import it."""
    program = write(
        tmp_path,
        "import sys\nfrom pathlib import Path\n"
        "from layoutexplore.agents import register_agent\n"
        "from layoutexplore.benchmark.config import BenchmarkConfig\n"
        "from layoutexplore.benchmark.runner import run_benchmark\n"
        "from layoutexplore.predictors import register_predictor\n"
        + AGENT.replace("min(self.skip", "helper(self.skip")
        + "helper = min\n"
        + ROOMS.replace("Mine", "Rooms")
        + "if __name__ == '__main__':\n"
        "    register_predictor('my-rooms', 'mine', Rooms)\n"
        "    register_agent('mine', 'mine', Mine)\n"
        f"    config = BenchmarkConfig(plans=[{str(plans / 'cottage.geojson')!r}], starts=1, explain=False,\n"
        "        agents=['mine:skip=1', Mine, 'layout-tour:predictor=my-rooms'], baseline='Mine')\n"
        "    done = run_benchmark(config, Path(sys.argv[1]), jobs=2)\n"
        "    print([row.error for row in done.rows], done.ran)\n",
        "program.py",
    )
    for expected in ("['', '', ''] 3", "['', '', ''] 0"):  # what is done is known in another session
        words = [sys.executable, program, str(tmp_path / "out")]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == expected, done.stdout + done.stderr


def test_a_choice_that_is_none_is_told(plans: Path, tmp_path: Path) -> None:
    path = write(tmp_path, AGENT.replace("return min(self.skip, len(decision.frontiers) - 1)", "return 99"))
    done = run_benchmark(config(plans, f"{path}:Mine"), tmp_path / "out")
    assert "99" in done.failed[0].error


def test_an_agent_brings_a_predictor_as_an_object() -> None:
    class Rooms:
        name = "rooms"

        def predict(self, decision: Decision) -> Decision:
            return decision

    class Mine(First):
        predictor = Rooms()

    wanted = BenchmarkConfig(agents=[Mine])
    simulation, _ = prepare(load_plan("apartment-03"), SimulationConfig(), wanted.agents[0])
    assert simulation.predictor is not None and simulation.predictor.name == "rooms"
