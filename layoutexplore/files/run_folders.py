"""Files of a run's folder: the final map, and others by the quarter of the floor that was seen."""

from __future__ import annotations

from pathlib import Path

from layoutexplore.errors import checks_arguments
from layoutexplore.files.reading import is_file

RUN_MAP = "map.yaml"
"""What the robot knows in the end."""

WHAT_A_RUN_SAW = "is the map of a run: what that robot had not seen is not part of this floor plan"
"""What is said where it passes for a floor plan."""

QUARTERLY = ("seen_{:03}.png", "prior_{:03}.png", "rooms_{:03}.geojson")
"""By percent seen: pictures, a plan known beforehand, the rooms believed."""

QUARTERLY_NAMES = tuple(name.format(percent) for name in QUARTERLY for percent in range(0, 101, 25))
"""All that a run may have."""


@checks_arguments
def is_of_run(path: Path) -> bool:
    """Whether a file lies in the folder of a run, which holds its track."""
    return is_file(path.with_name("track.csv"))
