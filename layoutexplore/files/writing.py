"""Files written whole or not at all: texts, JSON, TOML."""

from __future__ import annotations

import errno
import json
import math
import os
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import tomli_w

from layoutexplore.errors import ConfigError, WriteError, cause, checks_arguments, shortened
from layoutexplore.files.reading import shown_path

_HALF = ".part"
"""How the names of files end that are being written."""

_HALF_FILE = re.compile(rf"\..+\.[0-9a-z_]{{8}}{re.escape(_HALF)}", re.DOTALL)
_HALF_FOLDER = re.compile(rf"\.files\.[0-9a-z_]{{8}}{re.escape(_HALF)}")


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that replaces it when the block ends well, and vanishes otherwise.

    A device or a pipe (/dev/null, /dev/stdout) is not replaced but written to. Of a link, the file that it
    leads to is replaced. A file keeps its permissions; a new one has those of the process's umask.

    Raises:
        WriteError: The file cannot be written.
    """
    temporary = None
    if not isinstance(path, Path):
        raise WriteError(f"cannot write: a file is named by a Path, got {shortened(path)}")
    if "\0" in str(path):
        raise WriteError(f"{shortened(str(path))}: cannot write: a name cannot hold a null character")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = _half_written(path)
        yield temporary
        put_in_place(temporary, path)
    except OSError as error:
        raise WriteError(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        if temporary:
            temporary.unlink(missing_ok=True)


@contextmanager
@checks_arguments
def all_or_none(folder: Path) -> Iterator[Path]:
    """An empty folder whose files replace those of `folder` when the block ends well, and vanish otherwise.

    For files that belong together: whoever stops the block, or a full disk, leaves those that were there.

    Raises:
        WriteError: A file cannot be written.
    """
    try:
        made = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with tempfile.TemporaryDirectory(prefix=".files.", suffix=_HALF, dir=folder) as beside:
                try:
                    yield Path(beside)
                except WriteError as error:
                    raise WriteError(str(error).replace(beside, str(folder))) from error
                for file in sorted(Path(beside).iterdir()):
                    put_in_place(file, folder / file.name)
        finally:
            if made:
                with suppress(OSError):  # what is not empty stays
                    folder.rmdir()
    except OSError as error:
        raise WriteError(f"{folder}: cannot write: {error.strerror or error}") from error


@checks_arguments
def remove_half_written(folder: Path, *, deep: bool = False) -> None:
    """Remove what processes that were killed left half written, where no other process is writing.

    Args:
        folder: Where to look.
        deep: Look in its folders as well.
    """
    for path in (folder.rglob if deep else folder.glob)(f".*{_HALF}"):
        if path.is_file() and _HALF_FILE.fullmatch(path.name):
            path.unlink(missing_ok=True)
        elif path.is_dir() and _HALF_FOLDER.fullmatch(path.name):
            shutil.rmtree(path, ignore_errors=True)


def _half_written(path: Path) -> Path:
    """A new empty file to be written instead of `path`: nobody may read it who may not read that one."""
    if is_special(path):
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=_HALF)
        os.close(handle)
        return Path(name)
    place = _behind_links(path)
    place.parent.mkdir(parents=True, exist_ok=True)
    mode = place.stat().st_mode & 0o777 | 0o600 if place.exists() else 0o666
    # O_EXCL follows no link that somebody has put there.
    beside = place.with_name(f".{place.name}.{secrets.token_hex(4)}{_HALF}")
    os.close(os.open(beside, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode))
    return beside


def _behind_links(path: Path) -> Path:
    """Where the bytes of a file lie."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


@checks_arguments
def put_in_place(file: Path, path: Path) -> None:
    """Move a file to where it belongs; into a device or a pipe that is there its bytes are written.

    A file that is replaced leaves its permissions to the new one; a link leads to the new one as before.

    Raises:
        OSError: It cannot be written.
        WriteError: There is a disk.
    """
    if not is_special(path):
        place = _behind_links(path)
        if place.exists():
            file.chmod(stat.S_IMODE(place.stat().st_mode))
        try:
            file.replace(place)
        except OSError as error:
            if error.errno != errno.EXDEV:  # a link may lead to another disk
                raise
            with atomic(place) as beside:
                shutil.copyfile(file, beside)
        return
    if path.is_block_device():
        raise WriteError(f"{path}: cannot write: it is a disk")
    # Nobody may read the other end of a pipe: that is an error at once, and no wait without end.
    target = os.open(path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(target, "wb") as out, file.open("rb") as source:
        os.set_blocking(target, True)
        shutil.copyfileobj(source, out)


@checks_arguments
def is_special(path: Path) -> bool:
    """Whether what lies there is no file or folder, or a link to what a process has open (/dev/stdout)."""
    if path.is_symlink() and str(path.readlink()).startswith("/proc/"):
        return True
    return path.exists() and not (path.is_file() or path.is_dir())


@checks_arguments
def write_atomically(path: Path, data: bytes | str) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it.

    Raises:
        WriteError: It cannot be written.
    """
    with atomic(path) as temporary:
        # Half a character, of a file's name that is no text, is written as Python shows it.
        temporary.write_bytes(data.encode(errors="backslashreplace") if isinstance(data, str) else data)


@checks_arguments
def write_json(path: Path, data: Mapping[str, Any], *, indent: int | None = 1) -> None:
    """Write numbers; what is not a finite number becomes null, as JSON has no other word for it."""
    try:
        text = json.dumps(_finite(data), indent=indent, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise WriteError(
            f"{shown_path(path)}: cannot write what is no plain value: {cause(error)}"
        ) from error
    write_atomically(path, text + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@checks_arguments
def to_toml(table: Mapping[str, Any]) -> str:
    """Nested tables of strings, numbers, booleans and lists as TOML; keys with the value None are left out.

    Example:
        >>> print(to_toml({"a": [1, "x"], "t": {"b": None, "c": True}}))
        a = [
            1,
            "x",
        ]
        <BLANKLINE>
        [t]
        c = true
        <BLANKLINE>
    """
    try:
        return tomli_w.dumps(_without_none(table))
    except (TypeError, ValueError, RecursionError) as error:
        raise ConfigError(f"cannot write what is no plain value as TOML: {cause(error)}") from error


def _without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    return {_shown(key): _plain(value) for key, value in table.items() if value is not None}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _without_none(value)
    return [_plain(part) for part in value] if isinstance(value, list | tuple) else _shown(value)


def _shown(value: Any) -> Any:
    """Half a character, of a file's name that is no text, as Python shows it: no TOML may hold one."""
    return value.encode(errors="backslashreplace").decode() if isinstance(value, str) else value
