"""Reading what may be anything: regular files only, of a size that is known before."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from layoutexplore.errors import LayoutExploreError, checks_arguments, shortened, unknown_name
from layoutexplore.files.limits import limits, raise_it

MEGA = 1_000_000

_NO_WAITING = sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))

Kind = type[LayoutExploreError]
"""The class of the error that a reader raises."""

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


@checks_arguments
def read_bytes(path: Path, error: Kind, what: str = "file", *, limit: str = "file_mb") -> bytes:
    """The content of a regular file.

    Args:
        path: The file; a link to one is followed.
        error: What is raised.
        what: What it is to be, for messages: "image", "plan".
        limit: The limit of its size.

    Raises:
        LayoutExploreError: Of the kind `error`: there is no such file, it may not be read, is a folder, pipe
            or device, or is larger than the limit.
    """
    allowed = dataclasses.asdict(limits())
    if limit not in allowed:
        raise unknown_name("limit", limit, allowed)
    most = int(allowed[limit] * MEGA)
    try:
        _check_regular(path.stat().st_mode, path, error, what)  # before it is opened: that can do something
        # A pipe that took the file's place meanwhile must not make us wait for a writer.
        with open(os.open(path, os.O_RDONLY | _NO_WAITING), "rb") as file:  # noqa: PTH123
            status = os.fstat(file.fileno())
            _check_regular(status.st_mode, path, error, what)
            size = status.st_size
            data = b"" if size > most else file.read(size + 1)
    except (OSError, ValueError) as problem:
        if isinstance(problem, LayoutExploreError):
            raise
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"{shown_path(path)}: cannot read the {what}: {reason}") from problem
    if len(data) > size <= most:
        raise error(f"{path}: the {what} grew while it was read: try again")
    if size > most:
        raise error(
            f"{path}: the {what} has {size / MEGA:.4g} MB, and the limit {limit} is {most / MEGA:g}: "
            f"{raise_it(limit, size / MEGA)}"
        )
    return data


@checks_arguments
def is_there(path: Path) -> bool:
    """Whether there is such a file or folder: nowhere is one of a name that no file can have."""
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long, a character that none may hold
        return False


@checks_arguments
def is_file(path: Path) -> bool:
    """Whether there is such a file: none of a name that no file can have."""
    return is_there(path) and path.is_file()


def _check_regular(mode: int, path: Path, error: Kind, what: str) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for test, name in _KINDS if test(mode)), "no file")
        raise error(f"{path}: is {kind}: the {what} must be a regular file")


@checks_arguments
def read_text(path: Path, error: Kind, what: str = "file", *, limit: str = "file_mb") -> str:
    """The content of a regular UTF-8 file, without the mark that Windows begins it with; see `read_bytes`."""
    data = read_bytes(path, error, what, limit=limit)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        raise error(
            f"{path} is damaged or no text in UTF-8: byte {problem.start} of the {what} is "
            f"0x{data[problem.start]:02x}"
        ) from problem


def shown_path(path: Path) -> str:
    """A path as it can be printed, whatever characters it has."""
    text = str(path)
    return text if text.isprintable() and len(text) < 500 else shortened(text)


@contextmanager
def naming(path: Path, error: Kind, besides: Callable[[], Iterable[Path]] = tuple) -> Iterator[None]:
    """Errors that are raised within name the file: what checks its values does not know where they are from.

    Args:
        path: The file.
        error: The class of errors that are to name it; others pass as they are.
        besides: Other files that are read; an error that names one of them stays as it is.
    """
    try:
        yield
    except error as problem:
        text = str(problem)
        if _is_named(path, text) or any(_is_named(one, text) for one in besides()):
            raise
        raise type(problem)(f"{shown_path(path)}: {text}") from problem


@contextmanager
def blaming(path: Path | None, error: Kind, alone: Callable[[], object]) -> Iterator[None]:
    """Errors that are raised within name the file where it is wrong without what was given beside it, too.

    Args:
        path: The file; None where there is none.
        error: The class of the errors.
        alone: Does the same with the file alone.
    """
    try:
        yield
    except error:
        if path is not None:
            with naming(path, error):
                alone()
        raise


def _is_named(path: Path, text: str) -> bool:
    return str(path) in text or shown_path(path) in text


@checks_arguments
def fingerprint(files: Iterable[Path]) -> str:
    """12 hexadecimal digits that change when a file's content or its place in the order does.

    Raises:
        OSError: A file cannot be read.

    Example:
        >>> fingerprint([])
        'e3b0c44298fc'
    """
    digest = hashlib.sha256()
    for path in files:
        with path.open("rb") as file:  # weights may be large
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:12]


@functools.cache
def package_fingerprint() -> str:
    """The `fingerprint` of all modules and weights of this package: what they made before is another's."""
    package = Path(__file__).parents[1]
    beside = (package.parent / name for name in ("agents", "envs", "maps"))  # there in a checkout
    folders = [package, *(one for one in beside if (one / "__init__.py").is_file())]
    files = sorted(path for folder in folders for path in folder.rglob("*.*"))
    return fingerprint(path for path in files if path.suffix in (".py", ".json", ".safetensors"))
