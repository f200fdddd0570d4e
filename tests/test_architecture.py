"""The house: rooms on floors, no circle, small parts, each name once; read from the syntax trees."""

from __future__ import annotations

import ast
import importlib
import io
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MAPPED = ("envs", "agents", "maps")
"""Folders at the top of the repository that install as rooms of `layoutexplore`."""

FLOORS = {
    "__main__": 15,
    "cli": 14,
    "report": 13,
    "documentation": 13,
    "evaluation": 12,
    "training": 11,
    "benchmark": 11,
    "speed": 11,
    "agents": 10,
    "envs": 9,
    "drawing": 8,
    "predictors": 7,
    "simulation": 7,
    "priors": 6,
    "frontiers": 5,
    "importing": 5,
    "layout": 4,
    "sensing": 4,
    "planning": 4,
    "maps": 4,
    "closed_doors": 4,
    "grids": 3,
    "models": 3,
    "plugins": 3,
    "metrics": 2,
    "files": 2,
    "options": 2,
    "errors": 1,
    "processes": 1,
}
"""The floor of every room: an import goes to a lower one or stays in its room."""

HALL = {"__init__", "__main__", "errors", "options", "processes"}
LINES_OF_FILE, LINES_OF_FUNCTION, COLUMNS, MODULES_OF_FOLDER, PARAMETERS, COMMENTED_FROM = (
    400,
    50,
    110,
    16,
    8,
    25,
)
HEAVY = {"torch": {"training", "agents.rl", "speed"}, "sklearn": {"training", "agents.rl", "speed"}}


@cache
def modules() -> dict[str, Path]:
    """Every module by its dotted name without `layoutexplore.`; an `__init__` has its folder's."""
    found = {}
    for folder in ("layoutexplore", *MAPPED):
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            if parts[0] == "layoutexplore":
                parts = parts[1:]
                if parts[0] in MAPPED:
                    continue  # a link for type checkers
            found[".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)] = path
    return found


@cache
def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@cache
def files_of_tests() -> tuple[Path, ...]:
    return tuple(sorted((ROOT / "tests").rglob("*.py")))


@cache
def pages() -> tuple[Path, ...]:
    return tuple(sorted((ROOT / "layoutexplore" / "documentation" / "pages").rglob("*.md")))


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(text_of(modules()[module]))


@cache
def nodes(module: str) -> tuple[ast.AST, ...]:
    """Every node of a module's tree."""
    return tuple(ast.walk(tree(module)))


@cache
def imports(module: str) -> frozenset[str]:
    """Modules of the package that a module imports, inside functions and for type checkers too."""
    found = set()
    for node in nodes(module):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "layoutexplore":
            home = (node.module or "").partition(".")[2]
            for name in node.names:
                full = f"{home}.{name.name}".lstrip(".")
                found.add(full if full in modules() else home)
        elif isinstance(node, ast.Import):
            found |= {n.name.partition(".")[2] for n in node.names if n.name.startswith("layoutexplore.")}
    return frozenset(found - {"", module})


def room(module: str) -> str:
    return module.partition(".")[0]


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Groups of more than one node that reach each other."""
    reach: dict[str, set[str]] = {}
    for start in arrows:
        seen: set[str] = set()
        waiting = [start]
        while waiting:
            for other in arrows.get(waiting.pop(), set()) - seen:
                seen.add(other)
                waiting.append(other)
        reach[start] = seen
    groups = {
        frozenset({a, *(b for b in reach[a] if a in reach.get(b, set()))}) for a in arrows if a in reach[a]
    }
    return sorted(sorted(group) for group in groups)


@cache
def functions(module: str) -> tuple[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef], ...]:
    """Every function with its dotted name."""

    def walk(node: ast.AST, prefix: str) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield f"{prefix}.{child.name}", child
                yield from walk(child, f"{prefix}.{child.name}")
            elif isinstance(child, ast.ClassDef):
                yield from walk(child, f"{prefix}.{child.name}")
            else:
                yield from walk(child, prefix)

    return tuple(walk(tree(module), module))


def is_kernel(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether numba compiles it."""
    return any("njit" in ast.unparse(d) or "guvectorize" in ast.unparse(d) for d in node.decorator_list)


def length(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of the body, without the docstring."""
    body = node.body
    if ast.get_docstring(node) and len(body) > 1:
        body = body[1:]
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


@cache
def comment_lines(module: str) -> frozenset[int]:
    tokens = tokenize.generate_tokens(io.StringIO(text_of(modules()[module])).readline)
    return frozenset(token.start[0] for token in tokens if token.type == tokenize.COMMENT)


def check(rule: str, found: set[str]) -> None:
    """Nothing breaks a rule."""
    assert not found, f"{rule}: {sorted(found)}"


def test_no_circle_between_files() -> None:
    assert circles({name: set(imports(name)) for name in modules()}) == []


def test_no_circle_between_rooms() -> None:
    arrows: dict[str, set[str]] = defaultdict(set)
    for name in modules():
        arrows[room(name)] |= {room(other) for other in imports(name)} - {room(name)}
    assert circles(arrows) == []


def test_imports_go_down() -> None:
    unknown = {room(name) for name in modules()} - set(FLOORS) - {"__init__"}
    assert not unknown, f"rooms without a floor: {unknown}"
    upward = {
        f"{name} -> {other}"
        for name in modules()
        for other in imports(name)
        if room(name) != "__init__"
        and room(other) != room(name)
        and FLOORS[room(other)] >= FLOORS[room(name)]
    }
    assert not upward


def test_the_hall_is_empty() -> None:
    assert {path.stem for path in (ROOT / "layoutexplore").glob("*.py")} <= HALL


def test_files_are_short() -> None:
    check("long files", {n for n, p in modules().items() if text_of(p).count("\n") > LINES_OF_FILE})


def test_lines_are_short() -> None:
    paths = [*modules().values(), *files_of_tests()]
    wide = {str(p.relative_to(ROOT)) for p in paths if any(len(s) > COLUMNS for s in text_of(p).splitlines())}
    check("wide lines", wide)


def test_folders_are_small() -> None:
    count: dict[str, int] = defaultdict(int)
    for path in modules().values():
        count[str(path.parent.relative_to(ROOT))] += path.name != "__init__.py"
    check("full folders", {folder for folder, n in count.items() if n > MODULES_OF_FOLDER})


def test_functions_are_short() -> None:
    check(
        "long functions",
        {f for m in modules() for f, node in functions(m) if length(node) > LINES_OF_FUNCTION},
    )


def test_functions_take_few_parameters() -> None:
    many = set()
    for module in modules():
        if room(module) == "cli":
            continue  # a command's parameters are its options
        for name, node in functions(module):
            given = [*node.args.posonlyargs, *node.args.args]
            if not (room(module) == "envs" and name.endswith("Env.__init__")):
                given += node.args.kwonlyargs  # an environment's are those that users give gymnasium.make
            if sum(a.arg not in ("self", "cls") for a in given) > PARAMETERS:
                many.add(name)
    check("many parameters", many)


def test_public_names_mean_one_thing() -> None:
    homes: dict[str, set[str]] = defaultdict(set)
    for module in modules():
        for node in tree(module).body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
                homes[node.name].add(module)
    cli = {"register"}  # every module of commands has one
    check("shared names", {name for name, where in homes.items() if len(where) > 1} - cli)


def test_heavy_packages_stay_where_they_are_needed() -> None:
    guilty = set()
    for module in modules():
        for node in nodes(module):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [n.name for n in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                homes = HEAVY.get(name.partition(".")[0], {room(module)})
                if not any(module == home or module.startswith(f"{home}.") for home in homes):
                    guilty.add(f"{module}: {name}")
    check("heavy imports", guilty)


def test_columns_have_names() -> None:
    guilty = {
        module
        for module in modules()
        for node in nodes(module)
        if isinstance(node, ast.Subscript)
        and (getattr(node.value, "attr", "") == "columns" or getattr(node.value, "id", "") == "columns")
        and any(
            isinstance(part, ast.Constant) and isinstance(part.value, int) for part in ast.walk(node.slice)
        )
    }
    check("numbered columns", guilty)


def test_kernels_say_their_invariants() -> None:
    silent = set()
    for module in modules():
        for name, node in functions(module):
            if is_kernel(node) and (node.end_lineno or 0) - node.lineno + 1 >= COMMENTED_FROM:
                commented = any(
                    node.lineno <= line <= (node.end_lineno or 0) for line in comment_lines(module)
                )
                if not commented or not ast.get_docstring(node):
                    silent.add(name)
    check("silent kernels", silent)


DOTTED = re.compile(r"`(layoutexplore(?:\.\w+)+)`")
FILE = re.compile(r"`((?:layoutexplore|envs|agents|maps|tests)/[\w./-]*\w)`")


@cache
def names_of(module: str) -> frozenset[str]:
    """Names that a module uses, defines or imports."""
    names = {node.id for node in nodes(module) if isinstance(node, ast.Name)}
    for node in tree(module).body:
        names |= {node.name} if isinstance(node, (ast.FunctionDef, ast.ClassDef)) else set()
        names |= {a.asname or a.name for a in node.names} if isinstance(node, ast.ImportFrom) else set()
    return frozenset(names)


@cache
def exists(dotted: str) -> bool:
    """Whether a dotted name of the package can be reached, without importing what needs an extra."""
    parts = dotted.split(".")[1:]
    for k in range(len(parts), 0, -1):
        module = ".".join(parts[:k])
        if module in modules():
            return not parts[k:] or parts[k] in names_of(module)
    return hasattr(importlib.import_module("layoutexplore"), parts[0])


def test_names_in_backticks_exist() -> None:
    missing = set()
    for path in [*modules().values(), *files_of_tests(), ROOT / "README.md", *pages()]:
        text = text_of(path)
        here = path.relative_to(ROOT)
        missing |= {f"{here}: {name}" for name in DOTTED.findall(text) if not exists(name)}
        missing |= {f"{here}: {name}" for name in FILE.findall(text) if not (ROOT / name).exists()}
    check("dangling names", missing)


def test_tests_mirror_the_rooms() -> None:
    top = {
        "test_architecture.py",
        "test_packaging.py",
        "test_readme.py",
        *(f"test_{name}.py" for name in HALL),
    }
    loose = {p.name for p in (ROOT / "tests").glob("test_*.py")} - top
    folders = {
        ".".join(p.parent.relative_to(ROOT / "tests").parts) for p in (ROOT / "tests").rglob("test_*.py")
    } - {""}
    assert not loose, f"tests outside of a room's folder: {loose}"
    assert folders <= {*map(room, modules()), *(m.rpartition(".")[0] for m in modules())}
    check("rooms without tests", {room(m) for m in modules()} - {f.partition(".")[0] for f in folders} - HALL)


@pytest.mark.parametrize("path", files_of_tests(), ids=lambda p: p.stem)
def test_no_test_imports_a_private_name(path: Path) -> None:
    private = {
        f"{path.relative_to(ROOT)}: {name.name}"
        for node in ast.walk(ast.parse(text_of(path)))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("layoutexplore")
        for name in node.names
        if name.name.startswith("_") and not name.name.startswith("__")
    }
    assert not private


def test_lengths_are_in_metres() -> None:
    """No constant outside of `grids/` counts cells: it would mean another length on another grid."""
    guilty = set()
    for module in modules():
        if room(module) == "grids":
            continue
        lines = text_of(modules()[module]).splitlines()
        for node, after in zip(tree(module).body, [*tree(module).body[1:], None], strict=True):
            if not isinstance(node, ast.Assign) or not isinstance(node.value, (ast.Constant, ast.Tuple)):
                continue
            said = " ".join(lines[node.lineno - 1 : node.end_lineno]).partition("#")[2]
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                said += str(after.value.value)
            numbers = [n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
            if any(isinstance(n, (int, float)) for n in numbers) and re.search(
                r"\b(in|of|wide|# ?) ?(cells|pixels)\b|^ *cells", said, re.I
            ):
                guilty.add(f"{module}: {ast.unparse(node.targets[0])}")
    check("pixel counts", guilty)
