"""The report of an agent that is compared with nobody."""

from __future__ import annotations

from pathlib import Path

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.report.benchmark import write_benchmark_report


def pages(agents: tuple[str, ...], out: Path) -> list[str]:
    """The report of a small benchmark, as a page and as Markdown."""
    config = BenchmarkConfig(plans=("apartment-01",), starts=1, agents=agents, baseline="nearest")
    page, text, *_ = write_benchmark_report(run_benchmark(config, out).folder)
    return [page.read_text(), text.read_text()]


def test_a_report_that_compares_nothing_explains_no_comparison(tmp_path: Path) -> None:
    for said in pages(("tour",), tmp_path / "alone"):
        assert "each run is compared" not in said.lower() and "interquartile means of log" not in said
        assert "“Coverage gained”" not in said and "How to read this" in said
    page, text = pages(("nearest", "tour"), tmp_path / "both")
    assert "and each run is compared with that of nearest in the same cell." in page
    assert "Each run is compared with that of nearest" in text and "“Coverage gained”" in page


def test_an_agent_alone_is_neither_the_best_nor_the_worst(tmp_path: Path) -> None:
    page, _ = pages(("tour",), tmp_path / "alone")
    assert "<b>tour</b><br>" in page
    page, _ = pages(("nearest", "tour"), tmp_path / "both")
    captions = [f"({word}" in page for word in ("best", "worst")]
    assert captions == [True, True]
