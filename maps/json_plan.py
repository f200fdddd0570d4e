"""Reading a plan that is JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from layoutexplore.errors import MapError


def read_json(path: Path) -> Any:
    """What a JSON file holds.

    Raises:
        MapError: It cannot be read, or is no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MapError(f"{path}: cannot read the plan: {error.strerror}") from error
    except ValueError as error:
        raise MapError(f"{path}: broken JSON: {error}") from error
