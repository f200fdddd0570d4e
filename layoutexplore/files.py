"""Files: written whole or not at all, read with errors that say what is wrong with them; nothing is unpickled."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import MapError, ResultsError


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise MapError(f"{path}: cannot write: {error.strerror}") from error


_HALF = ".part"
"""How the names of files end that are being written."""


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that replaces it when the block ends well, and vanishes when it does not.

    Raises:
        ResultsError: The file cannot be written.
    """
    temporary = path
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=_HALF, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        raise ResultsError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if temporary is not path:
            temporary.unlink(missing_ok=True)


def read_arrays(path: Path, *names: str) -> dict[str, NDArray[Any]]:
    """Arrays of an .npz archive by name.

    Args:
        path: The archive.
        names: Those to read; all when none is named.

    Raises:
        ResultsError: It is missing, cannot be read, is cut off or damaged, or lacks an array.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in names or data.files}
    except FileNotFoundError as error:
        raise ResultsError(f"{path} is missing") from error
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        raise ResultsError(f"{path} is damaged: {error}") from error


def is_whole(path: Path) -> bool:
    """Whether an archive is there and was written to its end: its table of contents comes last."""
    return path.is_file() and zipfile.is_zipfile(path)


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
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:12]


def to_toml(table: dict[str, Any]) -> str:
    """Nested tables of strings, numbers, booleans and lists as TOML; keys with the value None are left out.

    Example:
        >>> print(to_toml({"a": [1, "x"], "t": {"b": None, "c": True}}))
        a = [1, "x"]
        <BLANKLINE>
        [t]
        c = true
        <BLANKLINE>
    """
    lines: list[str] = []
    _write_table(table, [], lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _write_table(table: dict[str, Any], path: list[str], lines: list[str]) -> None:
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and v is not None}
    if path and plain:
        lines.append(f"\n[{'.'.join(map(_key, path))}]")
    lines.extend(f"{_key(k)} = {json.dumps(v, ensure_ascii=False)}" for k, v in plain.items())
    for key, value in table.items():
        if isinstance(value, dict):
            _write_table(value, [*path, key], lines)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def check_places(out: Path | None, json_file: Path | None = None) -> None:
    """See whether a folder of results and a file of numbers can be written; nothing is made yet.

    Args:
        out: What `--out` names.
        json_file: What `--json` names.

    Raises:
        ConfigError: There is a file where the folder is to be, a folder where the file is to be, or no
            permission.
    """
    from layoutexplore.errors import ConfigError

    if json_file is not None and json_file.is_dir():
        raise ConfigError(f"{json_file} is a folder: --json must name a file")
    for option, folder in (("--out", out), ("--json", None if json_file is None else json_file.parent)):
        if folder is None:
            continue
        there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
        if not there.is_dir():
            raise ConfigError(f"{there} is a file: {option} cannot name a folder there")
        if not os.access(there, os.W_OK | os.X_OK):
            raise ConfigError(f"{there}: no permission to write there; choose another place with {option}")
