"""Labels of lines: what is shown of names."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.drawing.labels import BEGINNING, END, SEEN_WHOLE, names_apart

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
