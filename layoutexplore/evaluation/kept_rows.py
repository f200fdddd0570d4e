"""Rows of a study that are kept as they come: a study that was stopped goes on where it was."""

from __future__ import annotations

import dataclasses
import hashlib
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import NDArray

from layoutexplore.errors import ResultsError, checks_arguments
from layoutexplore.files import ArrayRule, read_arrays, safe_name, write_arrays
from layoutexplore.files.reading import is_there, package_fingerprint

Row = TypeVar("Row")

_ARRAY = "array"
_KINDS = {"str": "U", "int": "i", "float": "f"}


@checks_arguments
def kept_file(folder: Path | None, name: str, *made_from: Any) -> Path | None:
    """Where rows are kept in a folder: what they are made from, and by which code, tells files apart."""
    if folder is None:
        return None
    digest = hashlib.sha256(repr((package_fingerprint(), *made_from)).encode()).hexdigest()
    return folder / f"{safe_name(name)}-{digest[:16]}.npz"


@checks_arguments
def kept_rows(
    path: Path | None,
    kind: type[Row],
    make: Callable[[], tuple[Sequence[Row], NDArray[Any]]],
    rule: ArrayRule,
) -> tuple[list[Row], NDArray[Any]]:
    """Rows and an array with them: those of a file where they are kept, else what is made, which is kept.

    Args:
        path: The file; None keeps nothing.
        kind: Dataclass of the rows, of texts and numbers.
        make: Makes them.
        rule: What the array is.
    """
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    names = {field.name: _KINDS[str(field.type)] for field in fields}
    if path is not None and is_there(path):
        rules = {name: ArrayRule(kinds=kinds, shape=("rows",), finite=False) for name, kinds in names.items()}
        try:
            found = read_arrays(path, rules=rules | {_ARRAY: rule})
            columns = [found[name].tolist() for name in names]
            rows = [kind(**dict(zip(names, row, strict=True))) for row in zip(*columns, strict=True)]
            return rows, found[_ARRAY]
        except ResultsError as error:
            warnings.warn(f"{error}; it is made anew", stacklevel=2)
    made, array = make()
    rows = [*made]
    if path is not None:
        write_arrays(path, {name: [getattr(row, name) for row in rows] for name in names} | {_ARRAY: array})
    return rows, array
