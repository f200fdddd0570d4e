"""Numbers in the YAML of a ROS map: flags are none, and `negate` is a flag."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import MapError
from layoutexplore.grids.ros_map import load_grid


def write(folder: Path, **entries: str) -> Path:
    cv2.imwrite(str(folder / "map.png"), np.array([[0, 254]], np.uint8))
    given = {"image": "map.png", "resolution": "0.1", "origin": "[0, 0, 0]"} | entries
    (folder / "map.yaml").write_text("".join(f"{name}: {value}\n" for name, value in given.items()))
    return folder / "map.yaml"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("resolution", "true", "resolution must be a finite number"),
        ("origin", "[yes, 0, 0]", "origin must be a finite number"),
        ("origin", "[1e300, 0, 0]", r"origin must be a finite number up to 1e\+08, got '1e300'"),
        ("occupied_thresh", "true", "occupied_thresh must be a finite number"),
        ("negate", "5", "negate must be 0 or 1, got 5"),
        ("negate", "0.5", "negate must be 0 or 1"),
        ("negate", "-1", "negate must be 0 or 1"),
    ],
)
def test_what_is_no_number_is_refused(tmp_path: Path, name: str, value: str, message: str) -> None:
    with pytest.raises(MapError, match=rf"map\.yaml: {message}"):
        load_grid(write(tmp_path, **{name: value}))


@pytest.mark.parametrize(("value", "free"), [("0", 1), ("no", 1), ("1", 0), ("true", 0), ("'1'", 0)])
def test_negate_may_be_written_as_a_number_or_a_word(tmp_path: Path, value: str, free: int) -> None:
    assert np.flatnonzero(load_grid(write(tmp_path, negate=value)).free).tolist() == [free]
