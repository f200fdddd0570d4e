"""Labels of lines: what is shown of names."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.drawing.labels import (
    BEGINNING,
    END,
    LABEL_GAP,
    SEEN_WHOLE,
    label_gap,
    label_places,
    names_apart,
)

PARTS = st.lists(st.sampled_from(["tour", "policy", "a.py", "area", "2", "layout", "predictor"]), min_size=1)


@given(st.lists(st.builds(":".join, PARTS), unique=True))
def test_names_that_are_shown_differ_where_they_are_seen(names: list[str]) -> None:
    shown = names_apart(names)
    assert list(shown) == names and len(set(shown.values())) == len(names)
    for name, text in shown.items():
        assert text == name or (len(name) > SEEN_WHOLE and text.strip("…") in name)


def test_only_names_that_look_alike_are_cut() -> None:
    rough, true = "plan-tour:predictor=prior:rough", "plan-tour:predictor=prior:true"
    assert names_apart([rough, true]) == {rough: rough, true: true}
    first, second = (f"folder/mine.py:{name}:predictor=layout:ahead=2" for name in ("First", "Second"))
    assert first[:BEGINNING] == second[:BEGINNING] and first[-END:] == second[-END:]
    assert list(names_apart([first, "tour", second]).values()) == ["…First…", "tour", "…Second…"]


def test_a_name_that_another_one_begins_with() -> None:
    shorter, longer = "tour:area=2:area=2", "tour:area=2:area=2:area=2"
    assert names_apart([shorter, longer]) == {shorter: "…2", longer: "…2:area=2"}


@given(st.integers(1, 60))
def test_as_many_labels_as_there_are_have_room(count: int) -> None:
    gap = label_gap(count)
    assert 0.0 < gap <= LABEL_GAP
    places = label_places([0.5] * count, gap)
    assert places[-1] + gap <= 100.5
    assert all(b - a > 0.99 * gap for a, b in itertools.pairwise(places))
