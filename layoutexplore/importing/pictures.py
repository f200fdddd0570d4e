"""Maps and pictures of plans as grids, with what a user says about them: scale, unknown, outside."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

from layoutexplore.errors import (
    ConfigError,
    MapError,
    MapWarning,
    MissingExtraError,
    checks_arguments,
    shortened,
)
from layoutexplore.files.reading import is_there
from layoutexplore.grids.grid import OccupancyGrid, check_resolution
from layoutexplore.grids.outside import without_outside
from layoutexplore.grids.ros_map import (
    DEFAULT_RESOLUTION,
    IMAGE_SUFFIXES,
    YAML_SUFFIXES,
    UnknownGrey,
    load_grid,
)
from layoutexplore.grids.scale import metres_per_pixel
from layoutexplore.layout.blueprint import BlueprintConfig, load_blueprint
from layoutexplore.maps.formats.building_files import building_format
from layoutexplore.maps.library import OWN_SCALE, SUFFIXES

PLAN_SUFFIXES = tuple(suffix for suffix in SUFFIXES if suffix not in (*IMAGE_SUFFIXES, *YAML_SUFFIXES))
"""Of files that hold floor plans and no pictures."""


@dataclass(frozen=True, kw_only=True)
class PictureConfig:
    """What is said about a map or a picture of a plan.

    Attributes:
        resolution: Metres a pixel of a plain image; 0.05 is assumed when None. A ROS map brings its own, and
            takes none.
        blueprint: A drawn plan: words, symbols and door swings are erased, and only walls stay.
        unknown_grey: As for `load_grid`.
        image_anywhere: As for `load_grid`.
        keep_outside: Free space around the building stays free.
    """

    resolution: float | None = None
    blueprint: bool = False
    unknown_grey: UnknownGrey = "auto"
    image_anywhere: bool = False
    keep_outside: bool = False

    def check_unused(self, path: Path) -> None:
        """Raise `ConfigError` where something is said about a picture and the file is none to be read so."""
        if self != PictureConfig(resolution=self.resolution):
            raise ConfigError(
                f"{path} has rooms of its own: --blueprint, --unknown-grey, --image-anywhere and "
                "--keep-outside, which are for pictures without rooms, mean nothing for it"
            )


@checks_arguments
def picture_config(
    *,
    resolution: float | None = None,
    scale_by: str | None = None,
    blueprint: bool = False,
    unknown_grey: str = "auto",
    image_anywhere: bool = False,
    keep_outside: bool = False,
) -> PictureConfig:
    """The configuration that words of a command line mean.

    Args:
        resolution: Metres a pixel.
        scale_by: A known length instead: "3.2 m = 118 px".
        blueprint: As in `PictureConfig`.
        unknown_grey: "auto", "none" or a number.
        image_anywhere: As in `PictureConfig`.
        keep_outside: As in `PictureConfig`.

    Raises:
        ConfigError: Two scales are given, or a word makes no sense.
        MapError: The resolution is no number of metres above 0.

    Example:
        >>> picture_config(scale_by="2 m = 40 px", unknown_grey="205").resolution
        0.05
    """
    if scale_by is not None:
        if resolution is not None:
            raise ConfigError("--resolution and --scale-by both say what a pixel is: give one of them")
        resolution = metres_per_pixel(scale_by)
    if resolution is not None:
        check_resolution(resolution)
    words: dict[str, UnknownGrey] = {"auto": "auto", "none": "none", **{str(k): k for k in range(256)}}
    if unknown_grey not in words:
        raise ConfigError(
            f"--unknown-grey must be auto, none or a level from 0 to 255, got {shortened(unknown_grey)}"
        )
    return PictureConfig(
        resolution=resolution,
        blueprint=blueprint,
        unknown_grey=words[unknown_grey],
        image_anywhere=image_anywhere,
        keep_outside=keep_outside,
    )


@checks_arguments
def read_picture(path: str | os.PathLike[str], config: PictureConfig | None = None) -> OccupancyGrid:
    """A map or a picture of a plan as a grid, its outside unknown.

    Raises:
        MapError: It cannot be read, or shows no walls as a blueprint; a ROS map is to be one, or to have
            another scale than its own; a floor plan is no picture.

    Warns:
        MapWarning: Words were not looked for: the OCR is not installed; and what `load_grid` warns of.
    """
    path = Path(path)
    config = config or PictureConfig()
    suffix = path.suffix.lower()
    if building_format(path) or suffix in PLAN_SUFFIXES:
        raise MapError(
            f"{path}: is a floor plan, no map or image: `layoutexplore maps show` and `layoutexplore maps "
            "import` read it, as every command does that takes floor plans"
        )
    if is_there(path) and path.is_dir():
        first = next(
            (f for ending in (*YAML_SUFFIXES, *IMAGE_SUFFIXES) for f in path.glob(f"*{ending}")), None
        )
        raise MapError(f"{path}: is a folder: name one map inside it{f', as {first}' if first else ''}")
    if config.blueprint and suffix in YAML_SUFFIXES:
        raise MapError(f"{path}: a ROS map is no blueprint; give the image itself and its scale")
    if config.resolution is not None and suffix in YAML_SUFFIXES:
        raise MapError(f"{path}: {OWN_SCALE}")
    if config.blueprint:
        read = BlueprintConfig(keep_outside=config.keep_outside)
        return _read_blueprint(path, config.resolution or DEFAULT_RESOLUTION, read)
    grid = load_grid(
        path,
        resolution=config.resolution,
        unknown_grey=config.unknown_grey,
        image_anywhere=config.image_anywhere,
    ).trinary
    return grid if config.keep_outside else without_outside(grid)


def _read_blueprint(path: Path, resolution: float, config: BlueprintConfig) -> OccupancyGrid:
    """The blueprint; without the OCR, words are told from walls by their size alone."""
    try:
        return load_blueprint(path, resolution=resolution, config=config)
    except MissingExtraError as error:
        warnings.warn(f"{path}: words are erased by their size alone: {error}", MapWarning, stacklevel=3)
        return load_blueprint(path, resolution=resolution, config=replace(config, words=False))
