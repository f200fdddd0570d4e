"""Folders that one process writes into at a time."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from layoutexplore.errors import ResultsError, checks_arguments
from layoutexplore.files.writing import remove_half_written

LOCK = ".lock"
"""File that is held while a folder is written into."""


@contextlib.contextmanager
@checks_arguments
def held(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Hold a folder for one process; it is made where there is none, and goes again if it stays empty.

    What a process that was killed had half written in it goes as well.

    Args:
        path: The folder.
        what: What writes there, for the message.

    Raises:
        ResultsError: Another process holds it, or it cannot be written into.
    """
    path = Path(path)
    lock = path / LOCK
    holding = FileLock(lock, timeout=0)
    try:
        made = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
        holding.acquire()
        remove_half_written(path)
    except Timeout as error:
        raise ResultsError(
            f"another {what} is writing into {path}: wait for it, or choose another --out"
        ) from error
    except OSError as error:
        raise ResultsError(
            f"cannot write into {path} ({error.strerror}): choose another folder with --out"
        ) from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows removes no file that is open: releasing it does
            lock.unlink(missing_ok=True)
        holding.release()
        with contextlib.suppress(OSError):  # what is not empty stays
            for folder in made:
                folder.rmdir()
