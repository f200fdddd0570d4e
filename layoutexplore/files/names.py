"""File names for what users name: floor plans, agents, sensors, maps."""

from __future__ import annotations

import re
import zlib

from layoutexplore.errors import checks_arguments

_LONGEST = 120


@checks_arguments
def safe_name(name: str) -> str:
    """A file name for any name; names that had to be changed stay apart by a checksum.

    It has no separators of folders, does not begin with a dot and is not too long for a file system.

    Example:
        >>> safe_name("tour"), safe_name("office:12"), safe_name("../x")
        ('tour', 'office_12-41d6e872', '__x-1fb8ad98')
    """
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name)
    plain = re.sub(r"^\.+", "_", plain)[:_LONGEST] or "_"
    if plain == name:
        return name
    return f"{plain}-{zlib.crc32(name.encode(errors='surrogatepass')):08x}"
