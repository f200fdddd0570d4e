"""Files: written whole or not at all, read with errors that say what is wrong; nothing is unpickled."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import re
import tempfile
import tomllib
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ConfigError, ResultsError, WriteError

HALF = ".part"
"""How the names of files end that are being written."""


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that replaces it when the block ends well, and vanishes otherwise.

    Raises:
        WriteError: The file cannot be written.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=HALF, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        raise WriteError(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        if temporary:
            temporary.unlink(missing_ok=True)


def write_atomically(path: Path, data: bytes | str) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it.

    Raises:
        WriteError: It cannot be written.
    """
    with atomic(path) as temporary:
        temporary.write_bytes(data.encode() if isinstance(data, str) else data)


def write_csv(
    path: Path, rows: Sequence[Mapping[str, Any]], *, columns: Iterable[str] = (), digits: int | None = 6
) -> None:
    """Write a table with a header; without rows, and no columns named, an empty file.

    Args:
        path: The file.
        rows: Values by column.
        columns: In their order; those of the first row when none is named.
        digits: Significant digits of numbers that are no whole ones; all when None.
    """
    out = io.StringIO()
    names = list(columns) or list(rows[0] if rows else ())
    if names:
        writer = csv.DictWriter(out, names, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            short = {k: f"{v:.{digits}g}" for k, v in row.items() if digits and isinstance(v, float)}
            writer.writerow({**row, **short})
    write_atomically(path, out.getvalue())


def write_json(path: Path, data: Mapping[str, Any], *, indent: int | None = 1) -> None:
    """Write numbers; what is not a finite number becomes null, as JSON has no other word for it."""
    write_atomically(path, json.dumps(_finite(data), indent=indent, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_arrays(path: Path, arrays: Mapping[str, ArrayLike]) -> None:
    """Write arrays by name into a compressed .npz archive."""
    with atomic(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


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


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        ConfigError: It cannot be read, or is not valid TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read the configuration {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from error


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
