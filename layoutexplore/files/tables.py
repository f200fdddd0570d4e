"""Tables as CSV files."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from layoutexplore.errors import ResultsError, checks_arguments
from layoutexplore.files.reading import Kind, read_text
from layoutexplore.files.writing import write_atomically


@checks_arguments
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


@checks_arguments
def read_csv(path: Path, *, error: Kind = ResultsError, what: str = "table") -> list[list[str]]:
    """The lines of a CSV file, its header first, as texts.

    Raises:
        LayoutExploreError: Of the kind `error`: it cannot be read, or is no CSV in UTF-8.
    """
    return parse_csv(read_text(path, error, what), str(path), error=error)


@checks_arguments
def parse_csv(text: str, where: str, *, error: Kind = ResultsError) -> list[list[str]]:
    """The lines of a CSV text; see `read_csv`."""
    try:
        return list(csv.reader(io.StringIO(text, newline=""), strict=True))
    except csv.Error as problem:
        raise error(f"{where} is damaged: {problem}") from problem
