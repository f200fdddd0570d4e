"""The web site: it builds without a warning, and a fault in a page stops it."""

from __future__ import annotations

import errno
import shutil
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.documentation import site
from layoutexplore.documentation.reference import command_page
from layoutexplore.errors import LayoutExploreError, WriteError


def test_every_command_is_on_the_page_of_commands() -> None:
    page = command_page(typer.main.get_command(app))
    for command in ("benchmark", "explore", "maps import", "evaluate in-the-loop"):
        assert f"## `layoutexplore {command}`" in page
    assert "| `--plans` |" in page and "[bold]" not in page
    assert "Examples\n\n```bash\nlayoutexplore benchmark\nlayoutexplore benchmark --plans test" in page
    assert "Examples\n\n```bash\nlayoutexplore layout floor.yaml --out layouts\nlayoutexplore layout" in page
    assert "``" not in page.replace("```", "") and "| `MAP` |" in page and "`False`" not in page


def test_help_names_extras() -> None:
    for command, extra in (("docs", "docs"), ("train", "rl")):
        told = CliRunner().invoke(app, [command, "--help"]).output
        assert f"layoutexplore[{extra}]" in told


def test_the_site_is_built_without_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the extra `docs` builds it: a developer's formatter is a process for each of the signatures."""
    pytest.importorskip("mkdocs")
    for formatter in ("black", "ruff"):
        monkeypatch.setitem(sys.modules, formatter, None)
    page = site.build_site(tmp_path / "site", typer.main.get_command(app))
    assert "<h1" in page.read_text()
    modules = tmp_path / "site" / "reference" / "modules"
    assert "layoutexplore.frontiers.decision.Decision" in (modules / "frontiers.html").read_text()
    assert (tmp_path / "site" / "reference" / "commands.html").is_file()


def test_a_folder_with_other_files_is_left_as_it_is(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(LayoutExploreError, match="other files"):
        site.build_site(tmp_path, typer.main.get_command(app))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_broken_link_stops_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mkdocs")
    shutil.copytree(site.PAGES, tmp_path / "pages")
    (tmp_path / "pages" / "index.md").write_text("# Start\n\n[nowhere](nowhere.md)\n")
    monkeypatch.setattr(site, "PAGES", tmp_path / "pages")
    with pytest.raises(LayoutExploreError, match=r"nowhere\.md"):
        site.build_site(tmp_path / "site", typer.main.get_command(app), reference=False)


def test_a_full_disk_leaves_no_half_a_site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left would be taken for somebody else's files by the next build."""
    pytest.importorskip("mkdocs")
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "index.md").write_text("# Start")
    monkeypatch.setattr(site, "PAGES", tmp_path / "pages")
    copy, out = shutil.copyfile, tmp_path / "site"

    def refuse(source: str, target: str, **options: bool) -> str:
        if Path(target).is_relative_to(out) and target.endswith(".js"):
            raise OSError(errno.ENOSPC, "No space left on device")
        return str(copy(source, target, **options))

    monkeypatch.setattr(shutil, "copyfile", refuse)
    with pytest.raises(WriteError, match=r"site: cannot write the site: .*No space left on device$"):
        site.build_site(out, typer.main.get_command(app), reference=False)
    assert not list(out.iterdir())
