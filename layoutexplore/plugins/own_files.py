"""The files of a user's own code: of a module, and of what it imports from beside and below it.

Files have the names by which they are imported: one that is a link counts by what it leads to now.
"""

from __future__ import annotations

import contextlib
import dis
import hashlib
import sys
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any


def digest_of_files(files: dict[Path, bytes]) -> str:
    """12 hexadecimal digits that change with the content of files, wherever they lie."""
    content = b"".join(hashlib.sha256(files[path]).digest() for path in sorted(files))
    return hashlib.sha256(content).hexdigest()[:12]


def files_of(module: ModuleType) -> dict[Path, bytes]:
    """The file of a module and those that it imports from its own folder, or from that of its package.

    An import within a function counts, too, and one of a mere number. Packages that are installed in an
    environment within that folder do not count, and neither does this one.
    """
    path = own_file(module)
    if path is None:
        return {}
    depth = module.__name__.count(".") + hasattr(module, "__path__")
    folder = (path.parents[depth] if module.__package__ else path.parent).resolve()
    found: dict[Path, bytes] = {}
    waiting = [module]
    while waiting:
        module = waiting.pop()
        file = own_file(module)
        path = next((name for name in names_of(file) if folder in name.parents), None) if file else None
        if path is None or path in found:
            continue
        found[path] = path.read_bytes()
        for value in list(vars(module).values()):
            home = value if isinstance(value, ModuleType) else sys.modules.get(home_of(value))
            if home is not None:
                waiting.append(home)
    return with_imports(found, folder)


def with_imports(files: dict[Path, bytes], folder: Path) -> dict[Path, bytes]:
    """Files, and those within a folder that they import, or that these import, and so on."""
    found, unread = dict(files), list(files)
    while unread:
        here = unread.pop()
        for path in _imported(here, found[here], folder):
            if path not in found:
                found |= (content := contents([path]))
                unread += content
    return found


def contents(paths: Iterable[Path]) -> dict[Path, bytes]:
    """What files hold; those that cannot be read are left out: they may never be imported."""
    found = {}
    for path in paths:
        with contextlib.suppress(OSError):
            found[path] = path.read_bytes()
    return found


def _imported(here: Path, source: bytes, folder: Path) -> Iterator[Path]:
    """The files within a folder that a file's source imports anywhere; of what is no Python, none."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            code = compile(source, here, "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    yield from files_imported(code, here.parent, {folder, here.parent}, folder)


def files_imported(code: CodeType, here: Path, bases: Iterable[Path], folder: Path) -> Iterator[Path]:
    """The files within a folder that code, or a function in it, imports.

    Args:
        code: As Python runs it.
        here: The folder of its file, from which relative imports count.
        bases: The folders where others begin.
        folder: What lies elsewhere is passed over.
    """
    for name, names, level in _imports(code):
        begin = (here, *here.parents)[level - 1 : level] if level else bases
        for last in ("", *names):  # each name may be a module, too
            parts = [*name.split("."), *filter(None, [last])]
            yield from files_named(parts, begin, folder)


def _imports(code: CodeType) -> Iterator[tuple[str, tuple[str, ...], int]]:
    """By import in code: the module, what is taken from it, how far up it begins."""
    shown = code.replace(co_consts=tuple(map(_showable, code.co_consts)))
    steps = [step for step in dis.get_instructions(shown) if step.opname != "EXTENDED_ARG"]
    for level, names, step in zip(steps, steps[1:], steps[2:], strict=False):
        if step.opname != "IMPORT_NAME":
            continue
        if level.argval or step.argval.partition(".")[0] != "layoutexplore":
            yield step.argval, names.argval or (), level.argval
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _imports(constant)


def files_named(parts: list[str], bases: Iterable[Path], folder: Path) -> Iterator[Path]:
    """The files of a dotted name and of the packages on the way to it, where they lie within a folder.

    The name begins with an empty part where it is relative to a package itself.
    """
    for base in bases:
        for count in range(1, len(parts) + 1):
            stem = base.joinpath(*parts[:count])
            for path in (stem / "__init__.py", stem.with_name(f"{stem.name}.py")):
                if folder in path.parents and not _is_installed(path) and path.is_file():
                    yield path


def own_file(module: ModuleType) -> Path | None:
    """The Python file of a module, unless it is one of this package or of an installed one."""
    name = getattr(module, "__file__", None)
    top = module.__name__.partition(".")[0]
    if not isinstance(name, str) or not name.endswith(".py") or top == "layoutexplore":
        return None
    path = Path(name).absolute()
    return None if _is_installed(path) or not path.is_file() else path


def names_of(path: Path) -> tuple[Path, ...]:
    """A file as it is named, with the links to its folder resolved, and where its bytes lie."""
    return path.absolute(), path.parent.resolve() / path.name, path.resolve()


def home_of(value: Any) -> str:
    """The name of the module in which a class or function was defined; empty where it is not known."""
    home = getattr(value, "__module__", None)
    return home if isinstance(home, str) else ""


def _is_installed(path: Path) -> bool:
    return "site-packages" in path.parts or "site-packages" in path.resolve().parts


def _showable(constant: object) -> object:
    """A constant of code, None in the place of a number of too many digits: `dis` writes all of them out."""
    try:
        repr(constant)
    except ValueError:
        return None
    return constant
