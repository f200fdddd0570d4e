"""Guards: nothing is left out of the wheel, nobody imports a second copy of a package."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import layoutexplore

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("layoutexplore", "envs", "agents", "maps")


def python_files() -> list[Path]:
    return [p for folder in SOURCES for p in (ROOT / folder).rglob("*.py") if not p.parent.is_symlink()]


def test_every_package_is_listed() -> None:
    setup = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    homes = {
        str(ROOT / setup["package-dir"].get(name, name.replace(".", "/"))): name for name in setup["packages"]
    }
    found = {str(p.parent) for p in python_files() if p.name == "__init__.py"}
    assert found == set(homes), "packages in pyproject.toml and folders with an __init__.py differ"


def test_model_cards_are_in_the_wheel_with_their_models() -> None:
    setup = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    for name in setup["packages"]:
        home = ROOT / setup["package-dir"].get(name, name.replace(".", "/"))
        cards = list(home.glob("*.md"))
        assert not cards or "*.md" in setup["package-data"].get(name, []), f"{name} leaves out {cards}"


@pytest.mark.parametrize("name", ["envs", "agents", "maps"])
def test_nobody_imports_a_second_copy(name: str) -> None:
    pattern = re.compile(rf"^\s*(import|from) {name}\b", re.MULTILINE)
    guilty = [
        str(p) for p in [*python_files(), *(ROOT / "tests").rglob("*.py")] if pattern.search(p.read_text())
    ]
    assert not guilty


def test_modules_have_docstrings() -> None:
    for path in python_files():
        assert path.read_text().lstrip().startswith('"""'), f"{path} has no module docstring"


@pytest.mark.parametrize("module", ["torch", "sklearn", "matplotlib", "pandas", "stable_baselines3"])
def test_import_is_light(module: str) -> None:
    code = (
        f"import sys, layoutexplore, layoutexplore.simulation.simulation; sys.exit({module!r} in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


@pytest.mark.parametrize(
    "imports", ["layoutexplore, gymnasium", "gymnasium, layoutexplore", "layoutexplore, gymnasium.spaces"]
)
def test_environments_are_known_to_gymnasium_in_whatever_order(imports: str) -> None:
    code = f"import {imports}; import gymnasium; gymnasium.spec('LayoutExplore/Frontier-v0')"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_benchmark_workers_need_no_gymnasium() -> None:
    code = (
        "import sys, layoutexplore.benchmark.runner; from layoutexplore.agents import make_agent; "
        "make_agent('layout-tour'); sys.exit('gymnasium' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_what_ci_runs_exists() -> None:
    named = re.findall(r"\btests/[\w./-]+", (ROOT / ".ci" / "run").read_text())
    assert len(named) >= 5 and [name for name in named if not (ROOT / name).exists()] == []


def test_completion_offers_what_is_public() -> None:
    offered = {name for name in dir(layoutexplore) if not name.startswith("_")}
    assert offered >= set(layoutexplore.__all__) - {"__version__"}
    assert all(f"layoutexplore.{name}" in sys.modules for name in offered - set(layoutexplore.__all__))
