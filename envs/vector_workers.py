"""Who steps the environments of a vector: this thread, a few threads, or worker processes with shared memory.

Each worker has its own group of environments (`EnvironmentGroup`). A command goes to all of them and the
answers are collected; between the two the caller may do something else.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import pickle
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from typing import Any, NamedTuple, Protocol

import cloudpickle  # type: ignore[import-untyped]  # gymnasium depends on it
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from layoutexplore.envs.base import ExplorationEnv
from layoutexplore.envs.vector_buffers import Buffers, EnvironmentGroup
from layoutexplore.errors import WorkerError
from layoutexplore.plugins.tracebacks import own_frames, told
from layoutexplore.plugins.transport import OwnCode, begin_quietly, pack_own_code, starting_workers
from layoutexplore.processes import deaf_children, single_threaded, without_main
from layoutexplore.processes.pools import begin_worker, worker_context

Make = Callable[[], ExplorationEnv[Any]]

_STEP, _DONE = pickle.dumps(("step", ())), pickle.dumps(None)
"""What travels most, packed once."""

_PATIENCE = 5.0
"""Seconds that a worker is given to end by itself."""


class WorkerSetup(NamedTuple):
    """What workers are made from.

    Attributes:
        make: Makes an environment; functions and classes that it needs may come from the main module.
        template: One of them, for its spaces.
        groups: Half-open ranges of rows, one per worker.
        autoreset: When the next episode begins.
        limit: Steps after which an episode is truncated, or None.
    """

    make: Make
    template: ExplorationEnv[Any]
    groups: Sequence[tuple[int, int]]
    autoreset: AutoresetMode
    limit: int | None


class Workers(Protocol):
    """Groups of environments that execute commands.

    Attributes:
        buffers: What all environments write, a row each.
        groups: Half-open ranges of rows, one per worker.
        ended: Nobody is left to execute a command: they were closed, or a worker died.
    """

    buffers: Buffers
    groups: Sequence[tuple[int, int]]
    ended: bool

    def start(self, command: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """Send a command of `EnvironmentGroup` to every worker, with its arguments."""

    def wait(self) -> list[Any]:
        """The workers' answers; raises what one of them raised."""

    def start_one(self, k: int, command: str, arguments: tuple[Any, ...]) -> None:
        """Send a command to one worker, which must not be busy."""

    def wait_one(self) -> int:
        """A worker that has answered its `start_one`; raises what it raised."""

    def close(self) -> None:
        """End it; never raises."""


class LocalWorkers:
    """One group of environments in this thread, or several on threads.

    Args:
        setup: What they are made from.
        threads: Whether each group has a thread of its own.
    """

    def __init__(self, setup: WorkerSetup, *, threads: bool) -> None:
        make, template, self.groups, autoreset, limit = setup
        self.buffers = Buffers.allocate(template, self.groups[-1][1], np.zeros)
        self.members = [
            EnvironmentGroup(make, self.buffers.rows(*group), autoreset, limit) for group in self.groups
        ]
        self._pool = ThreadPoolExecutor(len(self.groups), thread_name_prefix="envs") if threads else None
        self.ended = False
        self._answers: list[Any] = []
        self._futures: list[Future[Any]] = []
        self._single: dict[Future[Any], int] = {}
        self._done: list[int] = []

    def start(self, command: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """Send a command; without threads it is done at once."""
        tasks = list(zip(self.members, arguments, strict=True))
        if self._pool:
            for future in self._futures:  # after Ctrl-C: no two threads step one environment
                future.exception()
            self._futures = [self._pool.submit(member.execute, command, *given) for member, given in tasks]
        else:
            self._answers = [member.execute(command, *given) for member, given in tasks]

    def wait(self) -> list[Any]:
        """The workers' answers."""
        if self._pool:
            for future in self._futures:
                future.exception()
            self._answers = [future.result() for future in self._futures]
        return self._answers

    def start_one(self, k: int, command: str, arguments: tuple[Any, ...]) -> None:
        """Send a command to one worker; without threads it is done at once."""
        task = partial(self.members[k].execute, command, *arguments)
        if self._pool:
            self._single[self._pool.submit(task)] = k
        else:
            task()
            self._done.append(k)

    def wait_one(self) -> int:
        """A worker that has answered its `start_one`."""
        if not self._pool:
            return self._done.pop(0)
        done = next(iter(wait(self._single, return_when=FIRST_COMPLETED).done))
        k = self._single.pop(done)
        done.result()
        return k

    def close(self) -> None:
        """Close the environments and end the threads."""
        self.ended = True
        if self._pool:
            self._pool.shutdown()
        for member in self.members:
            member.close()


class ProcessWorkers:
    """Groups of environments in worker processes that write into memory shared with this one.

    The workers are not forked from this process (threads do not survive that), keep to one thread each, and
    do not import the program's main module: what they need travels by value. They end with this process,
    however it ends.

    Commands to a worker are numbered, and an answer has the number of its command: what answers one that
    Ctrl-C has cut short is not taken for what answers the next.

    Args:
        setup: What they are made from.
    """

    def __init__(self, setup: WorkerSetup) -> None:
        make, _, groups, autoreset, limit = setup
        self.groups, self.ended = groups, False
        self._processes: list[Any] = []
        self._pipes: list[Connection] = []
        self._waiting, self._numbers = [False] * len(groups), [0] * len(groups)
        made = partial(_make_with, pack_own_code(), make)
        settings = cloudpickle.dumps((made, groups[-1][1], autoreset, limit))
        try:
            with starting_workers():
                self._begin(setup.template, settings)
            self._waiting = [True] * len(groups)
            self.wait()
        except BaseException:
            self.close()
            raise

    def _begin(self, template: ExplorationEnv[Any], settings: bytes) -> None:
        """Make the shared memory, and start a worker for each group."""
        with single_threaded(), deaf_children():
            context = worker_context()
        blocks: list[Any] = []

        def shared(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
            blocks.append(context.RawArray(ctypes.c_uint8, max(1, int(np.prod(shape)) * dtype.itemsize)))
            return _array(blocks[-1], shape, dtype)

        self.buffers = Buffers.allocate(template, self.groups[-1][1], shared)
        with single_threaded(), without_main():
            for k, group in enumerate(self.groups):
                here, there = context.Pipe()
                process = context.Process(
                    target=_work,
                    args=(there, settings, blocks, group, dict(os.environ)),
                    daemon=True,
                    name=f"layoutexplore-envs-{k}",
                )
                process.start()
                there.close()
                self._processes.append(process)
                self._pipes.append(here)

    def start(self, command: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """Send a command; answers that were never collected (after Ctrl-C) no longer count."""
        self._waiting = [False] * len(self.groups)
        for k, given in enumerate(arguments):
            self.start_one(k, command, given)

    def start_one(self, k: int, command: str, arguments: tuple[Any, ...]) -> None:
        """Send a command to one worker."""
        self._numbers[k] += 1
        try:
            data = _STEP if command == "step" else cloudpickle.dumps((command, arguments))
            self._pipes[k].send_bytes(_numbered(self._numbers[k], data))
        except (BrokenPipeError, ConnectionError):
            raise self._death(k) from None
        self._waiting[k] = True

    def wait(self) -> list[Any]:
        """The workers' answers.

        Raises:
            WorkerError: A worker died.
        """
        answers = [self._answer_of(k) for k, waits in enumerate(self._waiting) if waits]
        for answer in answers:
            if isinstance(answer, _Failure):
                raise answer.error
        return answers

    def wait_one(self) -> int:
        """A worker that has answered.

        Raises:
            WorkerError: A worker died.
        """
        ready = wait_for([pipe for pipe, waits in zip(self._pipes, self._waiting, strict=True) if waits])
        k = next(k for k, pipe in enumerate(self._pipes) if pipe in ready)
        answer = self._answer_of(k)
        if isinstance(answer, _Failure):
            raise answer.error
        return k

    def _answer_of(self, k: int) -> Any:
        number = _numbered(self._numbers[k])
        try:
            while (answer := self._pipes[k].recv_bytes())[: len(number)] != number:
                continue
        except (EOFError, ConnectionError):
            raise self._death(k) from None
        self._waiting[k] = False
        return pickle.loads(answer[len(number) :])

    def close(self) -> None:
        """End the workers: by asking, then by force."""
        self.ended = True
        for pipe in self._pipes:
            with contextlib.suppress(OSError):
                pipe.send_bytes(_numbered(0, cloudpickle.dumps(("leave", ()))))
            pipe.close()
        for process in self._processes:
            process.join(_PATIENCE)
            for end in (process.terminate, process.kill):
                if process.is_alive():
                    end()
                    process.join(_PATIENCE)
            process.close()
        self._processes, self._pipes = [], []

    def _death(self, k: int) -> WorkerError:
        process, (begin, end) = self._processes[k], self.groups[k]
        process.join(_PATIENCE)
        code = process.exitcode
        self.close()
        killed = code is not None and code < 0
        cause = f"was killed by {signal.Signals(-code).name}" if killed else f"ended with exit code {code}"
        return WorkerError(
            f"worker {k} of {len(self.groups)} (environments {begin} to {end - 1}) {cause}; "
            "the vector environment is closed: make a new one, with fewer workers if memory ran out"
        )


def _numbered(number: int, data: bytes = b"") -> bytes:
    """A message behind its number."""
    return number.to_bytes(8, "little") + data


class _Failure:
    """An error that a worker answers with, noting its place in own code: tracebacks do not travel."""

    def __init__(self, error: Exception) -> None:
        self.error = error
        if own_frames(error):
            error.add_note(f"in a worker process: {told(error)}")


def _array(block: Any, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    count = int(np.prod(shape))
    return np.frombuffer(block, np.uint8)[: count * dtype.itemsize].view(dtype).reshape(shape)


def _make_with(code: OwnCode, make: Make) -> ExplorationEnv[Any]:
    """An environment, in a process where what its user has registered elsewhere is known as well."""
    with code.installed():
        return make()


def _work(
    pipe: Connection, settings: bytes, blocks: list[Any], group: tuple[int, int], environment: dict[str, str]
) -> None:
    """The life of a worker: make its environments, then execute commands until one says to leave."""
    import cv2

    begin_worker(environment)
    begin_quietly(partial(cv2.setNumThreads, 1))
    left = iter(blocks)
    with contextlib.suppress(EOFError, OSError):
        try:
            make, count, autoreset, limit = pickle.loads(settings)
            buffers = Buffers.allocate(make(), count, lambda shape, dtype: _array(next(left), shape, dtype))
            envs = EnvironmentGroup(make, buffers.rows(*group), autoreset, limit)
        except Exception as error:
            _answer(pipe, _numbered(0), _Failure(error))
            return
        _answer(pipe, _numbered(0), None)
        while True:
            message = pipe.recv_bytes()
            number = message[: len(_numbered(0))]
            command, arguments = pickle.loads(message[len(number) :])
            if command == "leave":
                break
            try:
                answer = envs.execute(command, *arguments)
            except Exception as error:
                answer = _Failure(error)
            _answer(pipe, number, answer)
        envs.close()


def _answer(pipe: Connection, number: bytes, answer: Any) -> None:
    """Send an answer behind its number; one that cannot travel becomes an error that says so."""
    if answer is None:
        pipe.send_bytes(number + _DONE)
        return
    try:
        data = cloudpickle.dumps(answer)
        pickle.loads(data)
    except Exception as error:
        what = answer.error if isinstance(answer, _Failure) else answer
        data = cloudpickle.dumps(
            _Failure(WorkerError(f"what a worker answers cannot be sent: {what!r} ({error})"))
        )
    pipe.send_bytes(number + data)
