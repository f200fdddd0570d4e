"""What a system does not have (Windows, macOS, musl) is done without."""

from __future__ import annotations

import builtins
import ctypes
import io
import os
import signal
import sys
from pathlib import Path
from typing import Any, NoReturn

import pytest

from layoutexplore import processes
from layoutexplore.processes import end_at_once, peak_memory, release_memory, usable_cores


def test_memory_is_not_told_where_nobody_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    def unreadable(*_: Any, **__: Any) -> NoReturn:
        raise FileNotFoundError("/proc/self/status")

    assert peak_memory() > 1e7
    monkeypatch.setattr(Path, "read_text", unreadable)
    monkeypatch.setitem(sys.modules, "resource", None)
    assert peak_memory() == 0


@pytest.mark.parametrize(("quota", "cores"), [("max 100000", 12), ("250000 100000", 3)])
def test_cores_are_those_of_the_container(monkeypatch: pytest.MonkeyPatch, quota: str, cores: int) -> None:
    told = "/sys/fs/cgroup/cpu.max"
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(12)), raising=False)
    monkeypatch.setattr(os.path, "exists", lambda name: name == told)
    monkeypatch.setattr(builtins, "open", lambda name: io.StringIO(quota) if name == told else None)
    assert usable_cores() == cores


@pytest.mark.parametrize("error", [OSError, TypeError])
def test_memory_stays_where_the_c_library_is_another(
    monkeypatch: pytest.MonkeyPatch, error: type[Exception]
) -> None:
    asked = []

    def refuse(name: str | None) -> NoReturn:
        asked.append(name)
        raise error("argument of type 'NoneType' is not iterable")

    monkeypatch.setattr(ctypes, "CDLL", refuse)
    release_memory()
    assert asked == [None]


def test_processes_end_where_there_is_no_sigkill(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = []

    def leave(status: int) -> NoReturn:
        raise SystemExit(status)

    monkeypatch.delattr(signal, "SIGKILL")
    monkeypatch.setattr(processes, "descendants", lambda _: [12345])
    monkeypatch.setattr(os, "kill", lambda *asked: ended.append(asked))
    monkeypatch.setattr(os, "_exit", leave)
    with pytest.raises(SystemExit):
        end_at_once()
    assert ended == [(12345, signal.SIGTERM)]
