"""Workers: what they know of the process that starts them, and what they have loaded before they begin."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import types
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import forkserver, heap
from pathlib import Path

import numpy as np
import pytest

from layoutexplore.benchmark.pool import run_all
from layoutexplore.envs.vector import FrontierVectorEnv
from layoutexplore.errors import WorkerError
from layoutexplore.plugins.transport import worker_pool
from layoutexplore.processes import descendants, single_threaded
from layoutexplore.processes.pools import worker_context
from tests.programs import said_by

PROGRAM = """
import layoutexplore.grids.grid
from layoutexplore.plugins.transport import worker_pool
with worker_pool(1) as pool:
    loaded = "'layoutexplore.grids.grid' in __import__('sys').modules"
    print(*pool.submit(eval, f"({loaded}, __import__('numpy').__file__)").result())
"""

OWN_FORKED = """
import multiprocessing, os, signal
def told():
    names = "OMP_NUM_THREADS", "PYTHONSAFEPATH"
    print({name: os.environ.get(name) for name in names}, signal.pthread_sigmask(signal.SIG_BLOCK, []))
if __name__ == "__main__":
    from layoutexplore.plugins.transport import worker_pool
    with worker_pool(1) as pool:
        pool.submit(int).result()
    process = multiprocessing.get_context("forkserver").Process(target=told)
    process.start()
    process.join()
"""

CHANCE = """
import layoutexplore.simulation.simulation
from layoutexplore.plugins.transport import worker_pool
load = "__import__('%s')"
text = (
    f"{load % 'time'}.sleep(0.3) or ('numpy.random' in {load % 'sys'}.modules, {load % 'os'}.getpid(), "
    f"{load % 'numpy'}.random.random(), {load % 'random'}.random())"
)
with worker_pool(2) as pool:
    for asked in [pool.submit(eval, text) for _ in range(2)]:
        print(*asked.result())
"""

COMPILES = """
import layoutexplore.grids
from layoutexplore.plugins.transport import worker_pool
compilation = "__import__('layoutexplore.processes.compilation', fromlist=['x'])"
text = (
    f"(setattr({compilation}, 'PATIENCE', -1.0), __import__('numba').njit(lambda x: x + 1)(2), "
    f"{compilation}.LISTENER.is_silent)"
)
with worker_pool(1) as pool:
    print(*pool.submit(eval, text).result()[1:])
"""

WARNS = """
import layoutexplore.maps
from layoutexplore.benchmark.pool import run_all
from layoutexplore.plugins.transport import worker_pool
load = "__import__('%s', fromlist=['x'])"
text = f"{load % 'warnings'}.warn('doors are missing', {load % 'layoutexplore.errors'}.MapWarning)"
with worker_pool(1) as pool:
    pool.submit(eval, text).result()
list(run_all(eval, [text], jobs=2, lost=print))
"""


def test_workers_have_the_environment_and_the_folder_of_their_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Those of each pool, not those of the first one."""
    for value in ("one", "two"):
        (tmp_path / value).mkdir()
        monkeypatch.chdir(tmp_path / value)
        monkeypatch.setenv("LAYOUTEXPLORE_OF_A_TEST", value)
        names = ("LAYOUTEXPLORE_OF_A_TEST", "OMP_NUM_THREADS", "PYTHONSAFEPATH")
        before = os.environ.get("PYTHONSAFEPATH")
        with worker_pool(1) as pool:
            assert list(pool.map(os.getenv, names)) == [value, "1", before]
            assert pool.submit(os.getcwd).result() == str(tmp_path / value)
        assert os.environ.get("PYTHONSAFEPATH") == before


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers are spawned elsewhere")
def test_a_program_has_its_own_forked_processes_as_if_there_were_no_workers(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(OWN_FORKED)
    words = [sys.executable, str(tmp_path / "program.py")]
    told = subprocess.run(words, capture_output=True, text=True, check=True)
    before = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "PYTHONSAFEPATH")}
    assert told.stdout == f"{before} set()\n" and not told.stderr


def test_workers_draw_by_chance_of_their_own() -> None:
    """Own code may use the generators that numpy and Python share; those of one process were all alike."""
    told = subprocess.run([sys.executable, "-c", CHANCE], capture_output=True, text=True, check=True)
    first, second = (line.split() for line in told.stdout.splitlines())
    assert first[0] == second[0] == "True"
    assert all(one != other for one, other in zip(first[1:], second[1:], strict=True))


def test_workers_say_nothing_of_kernels() -> None:
    """Who started them does; one that is forked from a process that listens would say it again."""
    told = subprocess.run([sys.executable, "-c", COMPILES], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["3", "True"] and not told.stderr


def test_workers_do_not_repeat_what_floor_plans_lack() -> None:
    """Who started them has read the plans: each worker would say it again, and with a line of our code."""
    told = subprocess.run([sys.executable, "-c", WARNS], capture_output=True, text=True, check=True)
    assert not told.stderr


def test_workers_are_spawned_where_sockets_have_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(server: forkserver.ForkServer) -> None:
        raise OSError("AF_UNIX path too long")

    monkeypatch.setattr(forkserver.ForkServer, "ensure_running", refuse)
    with single_threaded():
        assert worker_context().get_start_method() == "spawn"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers are spawned elsewhere")
def test_modules_are_loaded_beforehand_and_not_those_of_the_folder_one_is_in(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "numpy.py").write_text("raise SystemExit('not this one')")
    (tmp_path / "program.py").write_text(PROGRAM)
    words = [sys.executable, str(tmp_path / "program.py")]
    told = subprocess.run(words, cwd=tmp_path / "here", capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["True", np.__file__] and not told.stderr


def test_nothing_of_a_pool_is_at_work_when_it_has_ended() -> None:
    """A thread that still holds a lock while a program is forked would let its child wait for ever."""
    before = threading.active_count()
    for _ in range(3):
        with worker_pool(2) as pool:
            assert list(pool.map(abs, [-1, 2])) == [1, 2]
        assert threading.active_count() == before


def test_a_pool_that_cannot_be_started_says_why_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    with worker_pool(1):  # what forks workers, and the tracker of semaphores, stay
        pass
    below, submit, calls = descendants(os.getpid()), ProcessPoolExecutor.submit, []

    def refuse(pool: ProcessPoolExecutor, *given: object) -> object:
        calls.append(given)
        if len(calls) == 2:
            raise OSError(errno.EMFILE, "Too many open files")
        return submit(pool, *given)

    monkeypatch.setattr(ProcessPoolExecutor, "submit", refuse)
    with pytest.raises(WorkerError, match=r"cannot start worker processes .*Too many open files.*--jobs 1"):
        next(run_all(abs, [1, 2], jobs=2, lost=abs))
    assert set(descendants(os.getpid())) <= set(below)


def test_vector_environments_say_why_they_cannot_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a container without /dev/shm, and in a process that may not have children."""

    def refuse(size: int) -> object:
        raise FileNotFoundError(errno.ENOENT, "No such file or directory", "/dev/shm")

    with monkeypatch.context() as patch:
        patch.setattr("multiprocessing.heap.Arena", refuse)
        patch.setattr("multiprocessing.heap.BufferWrapper._heap", heap.Heap())
        with pytest.raises(WorkerError, match=r"'/dev/shm'.*backend=.threads"):
            FrontierVectorEnv(2, backend="processes", workers=2, plan="office-01")
    monkeypatch.setattr("multiprocessing.current_process", lambda: types.SimpleNamespace(daemon=True))
    with pytest.raises(WorkerError, match="daemonic"):
        FrontierVectorEnv(2, backend="processes", workers=2, plan="office-01")
    with pytest.raises(WorkerError, match="daemonic"):
        next(run_all(abs, [1, 2], jobs=2, lost=abs))


OWN_POOL = """
import multiprocessing, time
from layoutexplore.processes import asked_to_stop, end_on_signals

end_on_signals()
for _ in range(3):
    with multiprocessing.get_context("fork").Pool(2) as pool:  # which ends its workers by SIGTERM
        pool.map(abs, [-1, 2])
time.sleep(0.5)
print(asked_to_stop())
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing is forked here")
def test_a_signal_to_what_own_code_has_forked_ends_nothing_else(tmp_path: Path) -> None:
    assert said_by(OWN_POOL, tmp_path, from_stdin=False) == "0\n"
