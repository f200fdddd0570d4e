"""Floors of one building, by their names."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.maps.buildings import building_of

NUMBERED = ("building", "bldg", "haus", "house", "block")
"""Words before the number of a building."""


@given(
    st.from_regex(r"\A[a-z]{3,8}(-hall)?\Z").filter(lambda home: not home.endswith(NUMBERED)),
    st.sampled_from(["-", "_", " "]),
    st.sampled_from(["floor", "level", "OG", "EG", "gf", ""]),
    st.sampled_from(["-", "_", ""]),
    st.integers(-1, 40),
)
def test_floors_of_a_gis_are_of_one_building(home: str, mark: str, word: str, gap: str, floor: int) -> None:
    number = str(floor) if word and gap != "-" else str(abs(floor))
    assert building_of(f"{home}{mark}{word}{gap if word else ''}{number}", "geojson") == home


@pytest.mark.parametrize(
    ("name", "building"),
    [
        ("westport-house-floor-gf", "westport-house"),
        ("rathaus_EG", "rathaus"),
        ("rathaus 2. OG", "rathaus"),
        ("annex12", "annex12"),
        ("dredging", "dredging"),
        ("office-og", "office-og"),
        ("7", "7"),
        ("level_3", ""),
    ],
)
def test_names_with_and_without_a_floor(name: str, building: str) -> None:
    assert building_of(name, "geojson") == building
