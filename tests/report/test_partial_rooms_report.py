"""The page of half-seen rooms: who competes."""

from __future__ import annotations

import re
from pathlib import Path

from layoutexplore.evaluation.partial_rooms import FrontierScore, RoomScore, Scores
from layoutexplore.evaluation.partial_rooms_summary import summarise_partial_rooms
from layoutexplore.report.studies.partial_rooms import Gallery, write_partial_rooms_report

IOUS = {"none": 0.0, "hull": 0.3, "layout": 0.6, "prior:true": 0.9, "oracle": 1.0, "oracle:flip=0.1": 0.95}
AT = {"plan": "a", "building": "a", "sensor": "short", "seed": 0, "coverage": 0.5}


def room(predictor: str, iou: float) -> RoomScore:
    return RoomScore(
        **AT, predictor=predictor, room=1, explored=0.4, iou=iou, hidden_iou=iou, log_area=0.0, boundary=0.1,
        remaining=3.0, true_remaining=4.0,
    )  # fmt: skip


def frontier(predictor: str) -> FrontierScore:
    return FrontierScore(
        **AT, predictor=predictor, x=1.0, y=2.0, closed=True, true_closed=True, area=1.0, true_area=1.0,
        confidence=0.9,
    )  # fmt: skip


def test_who_knows_more_than_the_map_tells_does_not_lead(tmp_path: Path) -> None:
    rooms = [room(name, iou) for name, iou in IOUS.items()]
    scores = Scores(rooms, [frontier(name) for name in IOUS], {name: [1.0] for name in IOUS})
    write_partial_rooms_report(
        tmp_path, scores, summarise_partial_rooms(scores), Gallery("layout"), command=""
    )
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    rows = re.findall(r"<tr[^>]*><td>([^<\n ]+)(.*?)</tr>", html, re.DOTALL)
    assert {name for name, rest in rows if 'class="lead"' in rest} == {"layout"}
    tags = {name: re.findall(r'class="tag">([^<]+)<', rest) for name, rest in rows[: len(IOUS)]}
    assert tags == {
        "none": ["bound"], "hull": [], "layout": [], "prior:true": ["knows a plan"], "oracle": ["bound"],
        "oracle:flip=0.1": ["bound"],
    }  # fmt: skip
