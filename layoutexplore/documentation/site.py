"""The documentation as a web site: the pages of this folder, and a reference made from the code itself.

`layoutexplore docs` calls `build_site`; the extra `docs` brings MkDocs, its Material theme and mkdocstrings.
"""

from __future__ import annotations

import logging
import re
import shutil
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

import layoutexplore
from layoutexplore.documentation.reference import Command, command_page, module_pages
from layoutexplore.errors import LayoutExploreError, ResultsError, WriteError, cause, require

PAGES = Path(__file__).resolve().parent / "pages"
ORDER = (
    *("exploration", "layouts", "strategies", "measures"),
    *("benchmark", "reading-results", "leaderboard", "clusters-and-long-runs"),
    *("own-building", "limits-and-safety", "prior-plans"),
    *("layouts-of-maps", "layout-methods-in-exploration", "half-seen-rooms", "foresight"),
    *("robot-behaviours", "noisy-robots", "environments", "training"),
    *("own-robot", "own-agent", "own-predictor", "own-layout-method"),
)
"""Pages in the order in which they stand in their section; others follow by name."""

MAPPED = ("envs", "agents", "maps")
"""Rooms that lie beside `layoutexplore/` in a checkout, inside it where it is installed."""

SECTIONS = {"concepts": "Concepts", "how-to": "How to", "reference": "Reference"}


def build_site(out: Path, command: Command, *, reference: bool = True) -> Path:
    """Builds the site into `out` and returns its first page.

    Args:
        out: Folder of the site; what a former build left in it is replaced.
        command: The command line, for the page of all commands.
        reference: With the pages of all public names (they take most of the time).

    Raises:
        LayoutExploreError: A page has a broken link, a name in it does not exist, MkDocs is missing, or the
            folder holds something else than a site of a former build.
        WriteError: It cannot be written; then nothing is left there.
    """
    for module in ("mkdocs", "material", "mkdocstrings"):
        require(module, "docs")
    _check_place(out)
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    with tempfile.TemporaryDirectory() as folder:
        pages, source = Path(folder) / "pages", Path(folder) / "source"
        _copy(PAGES, pages)
        commands = pages / "reference" / "commands.md"
        commands.parent.mkdir(exist_ok=True)
        commands.write_text(command_page(command), encoding="utf-8")
        if reference:
            _copy_source(source)
            for name, text in module_pages(source / "layoutexplore").items():
                (pages / "reference" / "modules").mkdir(exist_ok=True)
                (pages / "reference" / "modules" / f"{name}.md").write_text(text, encoding="utf-8")
        built = Path(folder) / "site"
        settings = _settings(pages, source, built)
        empty = Path(folder) / "mkdocs.yml"
        empty.write_text("site_name: layoutexplore\n", encoding="utf-8")
        complaints = _Complaints()
        logging.getLogger("mkdocs").addHandler(complaints)
        try:
            config = load_config(str(empty), **settings)
            config.plugins.run_event("startup", command="build", dirty=False)
            build(config)
            config.plugins.run_event("shutdown")
        finally:
            logging.getLogger("mkdocs").removeHandler(complaints)
        if complaints.lines:
            raise LayoutExploreError("the documentation has faults:\n" + "\n".join(complaints.lines))
        _empty(out)
        try:
            _copy(built, out)
        except WriteError:
            _empty(out)  # half a site would be taken for other files
            raise
    return out / "index.html"


def _empty(folder: Path) -> None:
    if folder.is_dir():
        for old in folder.iterdir():
            shutil.rmtree(old) if old.is_dir() and not old.is_symlink() else old.unlink()


def _copy(source: Path, folder: Path) -> None:
    try:
        shutil.copytree(source, folder, dirs_exist_ok=True)
    except OSError as error:
        reasons = error.args[0]  # of shutil: (from, to, why) of every file
        why = reasons[0][2] if isinstance(reasons, list) else cause(error)
        raise WriteError(f"{folder}: cannot write the site: {why}") from error


def _check_place(out: Path) -> None:
    """See that nobody else's files lie where the site is to be."""
    if out.is_dir() and any(out.iterdir()) and not (out / "reference" / "commands.html").is_file():
        raise ResultsError(f"{out} holds other files, which a site would replace: give an empty folder")


class _Complaints(logging.Handler):
    """Keeps every warning of the build."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


def _copy_source(source: Path) -> None:
    """One tree of the package for the reader of docstrings, wherever its rooms lie.

    That reader knows a section `Examples:` where ours say `Example:`.
    """
    home = source / "layoutexplore"
    folder = Path(layoutexplore.__file__).parent
    rooms = {Path(name): Path(import_module(f"layoutexplore.{name}").__path__[0]) for name in MAPPED}
    paths = {
        p.relative_to(folder): p for p in folder.rglob("*.py") if p.relative_to(folder).parts[0] not in MAPPED
    }
    paths |= {name / p.relative_to(room): p for name, room in rooms.items() for p in room.rglob("*.py")}
    for inside, path in paths.items():
        (home / inside).parent.mkdir(parents=True, exist_ok=True)
        text = re.sub(r"(?m)^( +)Example:$", r"\1Examples:", path.read_text("utf-8"))
        (home / inside).write_text(text, encoding="utf-8")


def _settings(pages: Path, source: Path, site: Path) -> dict[str, Any]:
    """What MkDocs is told; fonts and scripts stay on this machine."""
    options = {
        "docstring_style": "google",
        "show_root_heading": True,
        "show_source": False,
        "members_order": "source",
        "separate_signature": True,
        "show_signature_annotations": True,
        "show_if_no_docstring": False,
        "filters": ["!^_"],
    }
    handler = {"paths": [str(source)], "options": options}
    return {
        "docs_dir": str(pages),
        "site_dir": str(site),
        "nav": _navigation(pages),
        "use_directory_urls": False,
        "theme": {
            "name": "material",
            "font": False,
            "features": ["navigation.sections", "navigation.top", "content.code.copy", "toc.follow"],
            "palette": {"scheme": "default", "primary": "white", "accent": "blue"},
        },
        "plugins": ["search", {"mkdocstrings": {"handlers": {"python": handler}}}],
        "markdown_extensions": ["admonition", "attr_list", "tables", "toc", "pymdownx.superfences"],
        "validation": {"omitted_files": "warn", "absolute_links": "warn", "anchors": "warn"},
    }


def _navigation(pages: Path) -> list[Any]:
    """The pages by section, in their order, the pages of modules last."""
    found: list[Any] = [{"Start": "index.md"}]
    for folder, title in SECTIONS.items():
        names = sorted(p.name for p in (pages / folder).glob("*.md"))
        names.sort(key=lambda name: ORDER.index(name[:-3]) if name[:-3] in ORDER else len(ORDER))
        entries: list[Any] = [f"{folder}/{name}" for name in names]
        modules = sorted((pages / folder / "modules").glob("*.md"))
        if modules:
            entries.append({"Modules": [f"{folder}/modules/{p.name}" for p in modules]})
        if entries:
            found.append({title: entries})
    if (pages / "changelog.md").is_file():
        found.append({"Changes": "changelog.md"})
    return found
