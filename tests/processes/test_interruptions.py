"""Ctrl-C while worker processes are started: nobody complains."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from layoutexplore.processes import uninterrupted

on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers are spawned elsewhere")

PROGRAM = """
import os, signal, sys, time
from multiprocessing import popen_forkserver, reduction
from layoutexplore.processes import asked_to_stop, end_at_once, end_on_signals
from layoutexplore.processes.pools import start_pool

def interrupt():
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
    told = subprocess.run(
        [sys.executable, "-c", PROGRAM, when], capture_output=True, text=True, check=False, timeout=60
    )
    assert (told.returncode, told.stderr) == (130, "")


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Ctrl-C raises `KeyboardInterrupt`: a shell without job control lets its background jobs ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_signal_is_answered_at_the_end(interruptible: None) -> None:
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
