"""Ctrl-C while worker processes are started: nobody complains, and nothing stays in the system."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from layoutexplore.processes import uninterrupted

on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers are spawned elsewhere")

PROGRAM = """
import os, re, signal, sys, time
from multiprocessing import popen_forkserver, reduction
from pathlib import Path
from layoutexplore.processes import asked_to_stop, descendants, end_at_once, end_on_signals
from layoutexplore.processes.pools import start_pool

def interrupt():
    print(*set(re.findall("/dev/shm/sem[.].*", Path("/proc/self/maps").read_text())), flush=True)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.2)

def tell(*given, send=reduction.sendfds):
    interrupt()
    send(*given)

def write(*given, write=open, **named):
    interrupt()
    return write(*given, **named)

end_on_signals()
try:
    when = sys.argv[1]
    if when == "connecting":
        reduction.sendfds = tell
    if when == "writing":
        popen_forkserver.open = write
    pool = start_pool(2, int)
    interrupt()
finally:
    if asked_to_stop():
        end_at_once()
"""


@on_linux
@pytest.mark.parametrize("when", ["connecting", "writing", "started"])
def test_workers_that_are_being_started_do_not_complain(when: str) -> None:
    """What forks them was told but a part of what it needs, and said so in a traceback of its own."""
    with tempfile.TemporaryDirectory() as folder:
        told = subprocess.run(
            [sys.executable, "-c", PROGRAM, when],
            capture_output=True, text=True, check=False, timeout=60, env={**os.environ, "TMPDIR": folder},
        )  # fmt: skip
        assert (told.returncode, told.stderr) == (130, "")
        assert not list(Path(folder).iterdir())
        semaphores = told.stdout.split()
        assert semaphores and not any(Path(name).exists() for name in semaphores)


def test_a_signal_is_answered_at_the_end() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt):
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
            done.append(1)
        done.append(2)
    assert done == [1] and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_are_not_interrupted_anyway() -> None:
    handlers = []

    def run() -> None:
        with uninterrupted():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert handlers == [signal.getsignal(signal.SIGINT)]


STARTS = """
import os, subprocess, sys, time
from layoutexplore.processes import end_at_once
program = "import os, time\\nfor _ in range(200): os.fork() or os.execlp('sleep', 'sleep', '60')\\n"
subprocess.Popen([sys.executable, "-c", program])
time.sleep(float(sys.argv[1]))
end_at_once()
"""


@on_linux
@pytest.mark.parametrize("after", ["0.03", "0.05", "0.1"])
def test_who_is_starting_others_meanwhile_leaves_none(after: str) -> None:
    with subprocess.Popen([sys.executable, "-c", STARTS, after], start_new_session=True) as process:
        process.wait(60)
        assert not [it for it in Path("/proc").glob("[0-9]*") if _session(it) == process.pid]


def _session(process: Path) -> int:
    try:
        fields = (process / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[3]) * (fields[0] != "Z")
