"""Pages made from the code: every command with its options, every module with its public names."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from layoutexplore.errors import checks_arguments

MARKUP = re.compile(r"\[/?(?:bold|italic|dim|red|green|blue|yellow)\]")


class Command(Protocol):
    """What is read of a command of the command line (typer's, or click's)."""

    help: str | None
    epilog: str | None
    params: list[Any]


@checks_arguments
def command_page(command: Command) -> str:
    """All commands below `command` as one Markdown page: what each does, its arguments and options."""
    parts = ["# Commands", "", "What `layoutexplore COMMAND --help` prints, on one page.", ""]
    for path, found in _leaves(command, ("layoutexplore",)):
        parts += [f"## `{' '.join(path)}`", "", _page_of(found.help), ""]
        rows = [row for parameter in found.params if (row := _row(parameter))]
        if rows:
            parts += ["| option | default | meaning |", "|---|---|---|", *rows, ""]
        if found.epilog:
            title, commands = _plain(found.epilog).split(": ", 1)
            parts += [title, "", _block(commands.split("; ")), ""]
    return "\n".join(parts)


@checks_arguments
def module_pages(package: Path) -> dict[str, str]:
    """A page a room: `NAME -> Markdown`, with a mkdocstrings entry for each of its modules.

    Args:
        package: Folder of the whole package, every room inside.
    """
    pages = {}
    for room in sorted(package.iterdir()):
        if room.is_dir() and room.name not in ("documentation", "__pycache__"):
            modules = [m for m in sorted(room.rglob("*.py")) if _has_public_names(m)]
            names = [".".join(m.relative_to(package.parent).with_suffix("").parts) for m in modules]
            names = [name.removesuffix(".__init__") for name in names]
            summary = (ast.get_docstring(ast.parse((room / "__init__.py").read_text("utf-8"))) or "").strip()
            entries = [f"::: {name}" for name in names]
            pages[room.name] = "\n\n".join([f"# {room.name}", summary, *entries]) + "\n"
    return pages


def _has_public_names(module: Path) -> bool:
    defined = (ast.FunctionDef, ast.ClassDef)
    nodes = ast.parse(module.read_text("utf-8")).body
    return any(isinstance(node, defined) and not node.name.startswith("_") for node in nodes)


def _leaves(command: Command, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Command]]:
    """Commands that do something, groups walked through, in the order of the help."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield path, command
        return
    for name, found in inner.items():
        yield from _leaves(found, (*path, name))


def _row(parameter: Any) -> str | None:
    """One line of a table of options; `--help` itself is left out."""
    if "--help" in parameter.opts:
        return None
    named = parameter.param_type_name == "option"
    names = [*parameter.opts, *parameter.secondary_opts] if named else [parameter.metavar or parameter.name]
    default = parameter.default
    untold = default in (None, "", (), False) or callable(default)
    shown = "" if untold else f"`{default}`"
    text = _plain(getattr(parameter, "help", "") or "").replace("\n", " ").replace("|", "\\|")
    return f"| {', '.join(f'`{name}`' for name in names)} | {shown} | {text} |"


def _page_of(text: str | None) -> str:
    """Help as Markdown, the examples in it as code."""
    paragraphs = [part.strip() for part in _plain(text).split("\n\n")]
    commands = [part for part in paragraphs if part.startswith("layoutexplore ")]
    prose = [part for part in paragraphs if part not in commands]
    return "\n\n".join([*prose, _block(commands)] if commands else prose)


def _block(commands: list[str]) -> str:
    return "\n".join(["```bash", *commands, "```"])


def _plain(text: str | None) -> str:
    """Help without the marks of the terminal."""
    return MARKUP.sub("", text or "").replace("\b", "").strip()
