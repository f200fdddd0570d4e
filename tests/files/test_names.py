"""Names of floor plans and agents as file names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.files import safe_name

NAMES = st.text(min_size=1, max_size=300)


@given(st.lists(NAMES, min_size=2, max_size=2, unique=True))
def test_they_stay_apart_and_inside_of_their_folder(pair: list[str]) -> None:
    a, b = map(safe_name, pair)
    assert a != b
    for name in (a, b):
        assert re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*", name) and len(name) < 140
        assert (Path("/folder") / name).parent == Path("/folder")


@pytest.mark.parametrize(
    "name", ["/any/x", "..", ".", ".lock", "a/../../b", "\ud800", "x\0y", "a" * 5000, ""]
)
def test_hostile_names(name: str) -> None:
    assert re.fullmatch(r"_?[A-Za-z0-9_.-]+-[0-9a-f]{8}", safe_name(name))


@pytest.mark.parametrize("name", ["office-04", "50010535_PLAN2", "tour", "A.b-c_d"])
def test_plain_names_are_kept(name: str) -> None:
    assert safe_name(name) == name
