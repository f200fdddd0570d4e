"""The file that `--json` asks for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import typer


def write_json(path: Path, data: dict[str, Any], *, indent: int | None = 1) -> None:
    """Write numbers into a file and say so.

    Raises:
        MapError: It cannot be written.
    """
    from layoutexplore.grid_io import write_atomically

    write_atomically(path, (json.dumps(data, indent=indent) + "\n").encode())
    typer.echo(f"written: {path}")
