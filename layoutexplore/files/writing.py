"""Files written whole or not at all: texts, JSON, TOML."""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import tomli_w

from layoutexplore.errors import ConfigError, WriteError, cause, checks_arguments, shortened
from layoutexplore.files.reading import is_there, shown_path

HALF = ".part"
"""How the names of files end that are being written."""


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that replaces it when the block ends well, and vanishes otherwise.

    A device or a pipe (/dev/null, /dev/stdout) is not replaced but written to.

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
        folder = None if is_special(path) else path.parent
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=HALF, dir=folder)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        put_in_place(temporary, path)
    except OSError as error:
        raise WriteError(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        if temporary:
            temporary.unlink(missing_ok=True)


@checks_arguments
def put_in_place(file: Path, path: Path) -> None:
    """Move a file to where it belongs; into a device or a pipe that is there its bytes are written.

    Raises:
        OSError: It cannot be written.
        WriteError: There is a disk.
    """
    if not is_special(path):
        file.chmod(0o644)
        file.replace(path)
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
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if value is not None
    }


@checks_arguments
def check_places(
    out: Path | None, json_file: Path | None = None, *, file: str = "--json", **folders: Path | None
) -> None:
    """See whether folders of results and a file can be written; nothing is made yet.

    Args:
        out: What `--out` names.
        json_file: What the option `file` names.
        file: An option.
        folders: More folders by their options: `store` is what `--store` names.

    Raises:
        ConfigError: There is a file where a folder is to be, a folder where the file is to be, or no
            permission.
    """
    if json_file is not None and is_there(json_file) and json_file.is_dir():
        raise ConfigError(f"{json_file} is a folder: {file} must name a file")
    places = {"--out": out, file: None if json_file is None else json_file.parent}
    for option, folder in (places | {f"--{name}": place for name, place in folders.items()}).items():
        if folder is None:
            continue
        above = (folder, *folder.absolute().parents)
        there = next(place for place in above if is_there(place) or place.is_symlink())
        if not is_there(there):
            raise ConfigError(f"{there} is a link that leads nowhere: {option} cannot name a folder there")
        if not there.is_dir():
            raise ConfigError(f"{there} is a file: {option} cannot name a folder there")
        if not os.access(there, os.W_OK | os.X_OK):
            raise ConfigError(f"{there}: no permission to write there; choose another place with {option}")
