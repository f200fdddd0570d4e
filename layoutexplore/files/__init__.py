"""Files: written whole or not at all, read within limits with errors that say what is wrong.

Every kind of file has one function that reads it, and nothing else in the package does; nothing is unpickled.
"""

from __future__ import annotations

from layoutexplore.files.archives import ArrayRule, is_sound, is_whole, read_arrays, write_arrays
from layoutexplore.files.documents import parse_json, parse_toml, read_json, read_toml, read_yaml
from layoutexplore.files.limits import limits
from layoutexplore.files.names import safe_name
from layoutexplore.files.outputs import check_file, check_kept, check_places
from layoutexplore.files.reading import blaming, fingerprint, is_there, naming, read_bytes, read_text
from layoutexplore.files.tables import parse_csv, read_csv, write_csv
from layoutexplore.files.writing import (
    all_or_none,
    atomic,
    is_special,
    put_in_place,
    remove_half_written,
    to_toml,
    write_atomically,
    write_json,
)

__all__ = [
    "ArrayRule",
    "all_or_none",
    "atomic",
    "blaming",
    "check_file",
    "check_kept",
    "check_places",
    "fingerprint",
    "is_sound",
    "is_special",
    "is_there",
    "is_whole",
    "limits",
    "naming",
    "parse_csv",
    "parse_json",
    "parse_toml",
    "put_in_place",
    "read_arrays",
    "read_bytes",
    "read_csv",
    "read_json",
    "read_text",
    "read_toml",
    "read_yaml",
    "remove_half_written",
    "safe_name",
    "to_toml",
    "write_arrays",
    "write_atomically",
    "write_csv",
    "write_json",
]
