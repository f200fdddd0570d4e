"""Worker processes that know a user's own code, and need nothing of the program that starts them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from layoutexplore.errors import WorkerError
from layoutexplore.plugins.transport import worker_pool
from tests.programs import said_by, wherever_it_comes_from

PROGRAM = """
from layoutexplore import register_layout
from layoutexplore.layout.pipeline import method_names
from layoutexplore.plugins.transport import worker_pool

def build():
    return lambda grid: grid

register_layout("mine", "One of my own.", build)
with worker_pool(2) as pool:
    print("mine" in pool.submit(method_names).result(), *pool.map(abs, [-1, 2]))
    pool.shutdown()  # its processes end by themselves, and say nothing
"""


@wherever_it_comes_from
def test_a_program_needs_no_guard_and_what_it_registers_travels(from_stdin: bool, tmp_path: Path) -> None:
    assert said_by(PROGRAM, tmp_path, from_stdin=from_stdin) == "True 1 2\n"


def test_a_worker_that_dies_is_told() -> None:
    with pytest.raises(WorkerError, match=r"one of 1 worker processes was killed"), worker_pool(1) as pool:
        pool.submit(os._exit, 1).result()


def test_a_block_that_is_left_does_not_wait() -> None:
    with pytest.raises(KeyboardInterrupt), worker_pool(1) as pool:
        pool.submit(eval, "__import__('time').sleep(600)")
        raise KeyboardInterrupt
