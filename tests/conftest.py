"""Shared fixtures."""

from __future__ import annotations

import functools
import gc
import os
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
import typer.testing
from hypothesis import HealthCheck, settings

# Two test processes with a thread a core each get into each other's way: trainings took four times as long.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# All commands are made anew for each line that is given: nearly a tenth of a second, hundreds of times.
typer.main.get_command = typer.testing._get_command = functools.cache(typer.main.get_command)

# Hypothesis fails what takes longer than 200 ms: on a busy machine, or while kernels compile, anything may.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


@pytest.hookimpl(optionalhook=True)  # where there is no xdist
def pytest_xdist_auto_num_workers() -> int:
    """As many test processes as there are cores to use; each needs up to 1.5 GB."""
    from layoutexplore.processes import usable_cores

    return min(usable_cores(), 8)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile what kernels are missing: in tests, processes would wait for each other."""
    if hasattr(session.config, "workerinput") or not session.config.getoption("numprocesses", None):
        return
    from layoutexplore.cli.warm_up import warm_up_steps
    from layoutexplore.processes import usable_cores
    from layoutexplore.processes.kernel_list import compile_kernels, missing_kernels

    if missing := missing_kernels(name for name, _ in warm_up_steps()):
        sys.stderr.write(f"compiling {len(missing)} kernels, once\n")
        compile_kernels(missing, usable_cores())


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Nothing that is imported and collected is garbage: to look for some took a twentieth of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(autouse=True)
def environment() -> Iterator[None]:
    """What a test does to the environment is undone: others start processes with it."""
    before = dict(os.environ)
    yield
    if os.environ != before:
        os.environ.clear()
        os.environ.update(before)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real floor plans and maps; tests that need it skip where it is absent."""
    folder = Path(
        os.environ.get("LAYOUTEXPLORE_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
    )
    if not folder.is_dir():
        pytest.skip(
            f"no data folder at {folder}: set LAYOUTEXPLORE_DATA to run the tests on real floor plans"
        )
    return folder


@pytest.fixture
def closed_door_maps(tmp_path: Path) -> Path:
    """A folder with two explored maps of one office, its truth and a prediction."""
    from tests.closed_doors.cases import draw, office

    for k, shut in ((1, (2,)), (2, (2, 3))):
        seen, truth = office(shut)
        draw(seen, tmp_path / f"office_{k}_doors_IN.png")
        draw(truth, tmp_path / "office_GT.png")
    draw(truth, tmp_path / "office_1_doors_OUT.png")
    return tmp_path
