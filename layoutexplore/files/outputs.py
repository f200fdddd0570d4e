"""Where results may be written: in files of the right suffix, never over what they are made from."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from layoutexplore.errors import ConfigError, checks_arguments
from layoutexplore.files.reading import is_there
from layoutexplore.files.writing import is_special

FILE_SUFFIXES = (
    *(".png", ".pgm", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff", ".gif", ".mp4", ".pdf", ".html"),
    *(".yaml", ".yml", ".json", ".geojson", ".xml", ".osm", ".ifc", ".csv", ".toml", ".npz", ".txt"),
)
"""A folder of results that is not there yet is not named like these: a file was meant."""


@checks_arguments
def check_file(
    path: Path, *, suffixes: tuple[str, ...], option: str = "--out", kept: Iterable[Path] = ()
) -> None:
    """See whether a file can be written under this name; a device or a pipe (/dev/stdout) always can.

    Args:
        path: What is to be written.
        suffixes: Those of its kind, in small letters.
        option: What names the file.
        kept: Files that are read, and must stay as they are.

    Raises:
        ConfigError: It has another suffix, or is one of the files that must stay.

    Example:
        >>> check_file(Path("office.PNG"), suffixes=(".png",))
        >>> check_file(Path("office.jpg"), suffixes=(".png",))
        Traceback (most recent call last):
        ...
        layoutexplore.errors.ConfigError: office.jpg: --out must name a file that ends with .png
    """
    if is_special(path):
        return
    check_kept([path], kept, option=option)
    if path.suffix.lower() not in suffixes:
        raise ConfigError(f"{path}: {option} must name a file that ends with {' or '.join(suffixes)}")


@checks_arguments
def check_kept(written: Iterable[Path], kept: Iterable[Path], *, option: str = "--out") -> None:
    """See whether nothing is written over files that are read.

    Raises:
        ConfigError: Something is.
    """
    taken = {mark for file in kept for mark in _marks(file)}
    for path in written:
        if _marks(path) & taken:
            raise ConfigError(f"{path} is read and would be written over: {option} must name another place")


def _marks(path: Path) -> set[str | tuple[int, int]]:
    """What two names of one file share, whatever links lead there."""
    marks: set[str | tuple[int, int]] = {os.path.realpath(path)}
    if is_there(path):
        about = path.stat()
        marks.add((about.st_dev, about.st_ino))
    return marks


@checks_arguments
def check_places(
    out: Path | None, json_file: Path | None = None, *, file: str = "--json", **folders: Path | None
) -> None:
    """See whether folders of results and a file can be written; nothing is made yet.

    Args:
        out: What `--out` names.
        json_file: What the option `file` names.
        file: An option; what `--json` names ends with .json.
        folders: More folders by their options: `store` is what `--store` names.

    Raises:
        ConfigError: There is a file where a folder is to be, a folder where the file is to be, the file has
            another suffix, a new folder would be named like a file, or there is no permission.
    """
    if json_file is not None and is_there(json_file) and json_file.is_dir():
        raise ConfigError(f"{json_file} is a folder: {file} must name a file")
    if json_file is not None and file == "--json":
        check_file(json_file, suffixes=(".json",), option=file)
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
        if option != file and folder != there and folder.suffix.lower() in FILE_SUFFIXES:
            raise ConfigError(f"{folder} is named like a file: {option} must name a folder for the results")
        if not os.access(there, os.W_OK | os.X_OK):
            raise ConfigError(f"{there}: no permission to write there; choose another place with {option}")
