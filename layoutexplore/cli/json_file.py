"""The file that `--json` asks for."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import typer


def write_json(path: Path, data: dict[str, Any], *, indent: int | None = 1) -> None:
    """Write numbers into a file and say so; what is not a finite number becomes null, as JSON has no other word for it.

    Raises:
        MapError: It cannot be written.
    """
    from layoutexplore.files import write_atomically

    write_atomically(path, (json.dumps(_finite(data), indent=indent, allow_nan=False) + "\n").encode())
    typer.echo(f"written: {path}")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
