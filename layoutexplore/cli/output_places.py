"""Where a command is to write, looked at before it works for long."""

from __future__ import annotations

import os
from pathlib import Path


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
