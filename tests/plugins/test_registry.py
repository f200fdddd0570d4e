"""What is chosen by name, and what users add."""

from __future__ import annotations

import dataclasses
import re
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import pytest

from layoutexplore.agents import AGENTS, agent_names, make_agent, register_agent
from layoutexplore.agents.room_aware import LayoutTour, LayoutTourOptions
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.errors import ConfigError, OwnCodeError, UnknownNameError
from layoutexplore.layout.pipeline import LAYOUTS
from layoutexplore.plugins import registry
from layoutexplore.plugins.registry import Registry
from layoutexplore.predictors import PREDICTORS
from tests.plugins.cases import AGENT, write


class Still:
    """Stops at once.

    It needs no parameters.
    """

    def reset(self, seed: int) -> None: ...

    def act(self, decision: Any) -> int:
        return -1


@pytest.fixture
def shelf(monkeypatch: pytest.MonkeyPatch) -> Registry[Any]:
    monkeypatch.setattr(Registry, "by_kind", Registry.by_kind)
    return Registry("thing", "layoutexplore.things", lambda name, made: made, module=__name__)


def test_a_file_is_an_agent_with_the_parameters_of_its_class(tmp_path: Path) -> None:
    path = write(tmp_path)
    agent: Any = make_agent(f"{path}:Mine:skip=2")
    assert (agent.skip, agent.name) == (2, f"{path}:Mine:skip=2")
    assert make_agent(f"{path}:Mine").name == f"{path}:Mine"
    row = AGENTS.find(f"{path}:Mine")[0]
    assert row.doc == "Goes to the STEPth frontier. And more"


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("{}:Mine:skpi=2", "did you mean 'skip'"),
        ("{}:Mine:skip=two", "a whole number, got 'two'"),
        ("{}:Mine:", "nothing follows the colon"),
        ("{}:Mina", "did you mean 'Mine'"),
        ("{}:STEP", "has no reset"),
        ("{}/no.py:Mine", "cannot read the code: Not a directory"),
        ("{}", r"say which class or function, .*mine\.py:NAME"),
        ("{}:Mine,skip=2", r"say which class or function, .*mine\.py:NAME"),
        ("no.such.module:Mine", "no.such.module: there is no such module"),
        ("nosuchmodule:Mine", "unknown agent 'nosuchmodule'"),
        ("layuot-tour:predictor=mine.py:Rooms", "did you mean 'layout-tour'"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, spec: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_agent(spec.format(write(tmp_path)))


@dataclasses.dataclass(frozen=True)
class Frozen(Still):
    """Has parameters, and no name."""

    size: float = 1.0


class Nameless(Still):
    """Its name is none, and cannot be set."""

    @property
    def name(self) -> None:
        return None


SIGNATURES = """
class Forgetful:
    def reset(self): ...
    def act(self, decision): ...

class Curious:
    def reset(self, seed): ...
    def act(self, decision, memory): ...

class Blind:
    def rooms(self): ...

def careless(): ...
"""


@pytest.mark.parametrize(
    ("registry", "name", "message"),
    [
        (AGENTS, "Forgetful", "its reset takes (), but is called with (seed)"),
        (AGENTS, "Curious", "its act takes (decision, memory), but is called with (decision)"),
        (PREDICTORS, "Blind", "its rooms takes (), but is called with (decision)"),
        (LAYOUTS, "careless", "takes (), but is called with (grid)"),
    ],
)
def test_what_cannot_be_called_is_said(
    tmp_path: Path, registry: Registry[Any], name: str, message: str
) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        registry.make(f"{write(tmp_path, SIGNATURES)}:{name}")


def test_agents_that_cannot_change_have_a_name_or_are_told_so() -> None:
    here = f"{__name__}:Frozen"
    assert make_agent(f"{here}:size=2").name == f"{here}:size=2"
    with pytest.raises(ConfigError, match="needs an attribute name"):
        make_agent(f"{__name__}:Nameless")


def test_a_module_of_the_working_folder_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, name="strategies_of_mine.py")
    monkeypatch.chdir(tmp_path)
    assert make_agent("strategies_of_mine:Mine:skip=1").name == "strategies_of_mine:Mine:skip=1"


def test_a_class_of_a_shipped_kind_has_its_options(tmp_path: Path) -> None:
    text = "from layoutexplore.agents.room_aware import LayoutTour\nclass Later(LayoutTour):\n    pass\n"
    agent: Any = make_agent(f"{write(tmp_path, text)}:Later:area=4,predictor=none")
    assert agent.options.area == 4.0 and agent.predictor == "none"


@pytest.mark.parametrize(
    "text", ["class Mine:\n    def __init__(self, size): ...\n", "def Mine(plan=()): ...\n"]
)
def test_a_parameter_without_a_plain_default_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match=r"needs a default that is a flag, a number or a text"):
        make_agent(f"{write(tmp_path, text)}:Mine")


def test_code_that_fails_shows_its_own_traceback(tmp_path: Path) -> None:
    path = write(tmp_path, AGENT + "\nprint(undefined)\n")
    with pytest.raises(OwnCodeError, match="NameError: name 'undefined'") as caught:
        make_agent(f"{path}:Mine")
    assert f'File "{path}", line 17' in str(caught.value) and "plugins" not in str(caught.value)
    path = write(tmp_path, AGENT.replace("self.skip = skip", "1 / skip"), "other.py")
    with pytest.raises(OwnCodeError, match=r"cannot be made:(.|\n)*ZeroDivisionError"):
        make_agent(f"{path}:Mine")


def test_a_registered_class_and_its_parameters() -> None:
    register_agent("still", "stops at once", Still)
    register_agent("far-tour", "another tour", LayoutTour, LayoutTourOptions(area=9.0))
    agent: Any = make_agent("far-tour:patience=2")
    assert (agent.name, agent.options.area) == ("far-tour:patience=2", 9.0)
    assert isinstance(make_agent("still"), Still)
    assert {"still", "far-tour"} <= set(AGENTS.names())
    assert {entry.name for entry in AGENTS.own()} >= {"still", "far-tour"}


def test_names_that_ship_and_names_of_others_are_not_taken(shelf: Registry[Any]) -> None:
    shelf.register("mine", "", Still)
    shelf.register("mine", "", Still)
    with pytest.raises(ConfigError, match="already"):
        shelf.register("mine", "", LayoutTour)
    with pytest.raises(ConfigError, match="already"):
        register_agent("nearest", "", Still)
    with pytest.raises(ConfigError, match="none of"):
        shelf.register("a:b", "", Still)


@pytest.mark.parametrize("name", [None, 3, 2.5, b"x", [], {}, object(), "", "a\nb", "a\tb"])
def test_a_name_is_a_text(shelf: Registry[Any], name: Any) -> None:
    with pytest.raises(ConfigError, match="cannot name an own"):
        shelf.register(name, "", Still)


@pytest.mark.parametrize("options", [3, "x", [], {"a": 1}, object(), Still])
def test_options_are_an_object_of_a_dataclass(shelf: Registry[Any], options: Any) -> None:
    with pytest.raises(ConfigError, match="an object of a frozen dataclass"):
        shelf.register("mine", "", Still, options)
    with pytest.raises(ConfigError, match="a text says what it does"):
        shelf.register("mine", [options], Still)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="a class, a function or an object of a class"):
        shelf.register("mine", "", 3)  # type: ignore[arg-type]


def test_an_object_is_known_by_its_name(shelf: Registry[Any]) -> None:
    assert shelf.register_object(Still) == "Still" and shelf.find("Still")[0].doc == "Stops at once"
    ready = Still()
    ready.name = "ready"  # type: ignore[attr-defined]
    assert shelf.register_object(ready) == "ready"
    assert shelf.make("ready") is not ready and isinstance(shelf.make("ready"), Still)


@pytest.mark.parametrize("value", [None, 3, 2.5, b"x", [Still], {"a": Still}])
def test_what_is_no_code_is_not_registered(shelf: Registry[Any], value: Any) -> None:
    before = shelf.names()
    with pytest.raises(ConfigError, match="a class, a function or an object of a class"):
        shelf.register_object(value)
    assert shelf.names() == before


@pytest.mark.parametrize("name", ["plans", "sensors"])
def test_plans_and_sensors_of_a_benchmark_are_names(name: str) -> None:
    before = agent_names()
    with pytest.raises(ConfigError, match=f"{name} are given by name, got "):
        BenchmarkConfig(**{name: [Still()]})
    assert agent_names() == before


def test_entry_points_of_installed_packages(monkeypatch: pytest.MonkeyPatch, shelf: Registry[Any]) -> None:
    points = EntryPoints(
        [
            EntryPoint("theirs", "tests.plugins.test_registry:Still", "layoutexplore.things"),
            EntryPoint("broken", "tests.plugins.nowhere:Still", "layoutexplore.things"),
        ]
    )
    monkeypatch.setattr(registry, "entry_points", lambda group: points.select(group=group))
    assert shelf.names() == ["theirs", "broken"]
    assert isinstance(shelf.make("theirs"), Still) and shelf.digest("theirs")
    with pytest.raises(OwnCodeError, match=r"tests\.plugins\.nowhere"):
        shelf.make("broken")
    assert [row.name for row in shelf.describe()] == ["theirs", "broken"]
    assert "cannot be loaded" in shelf.describe()[1].summary
    with pytest.raises(UnknownNameError, match="did you mean 'theirs'"):
        shelf.make("their")


@pytest.mark.parametrize("shipped", [AGENTS, PREDICTORS, LAYOUTS], ids=lambda r: r.kind)
def test_everything_that_ships_says_what_it_does(shipped: Registry[Any]) -> None:
    for row in shipped.describe():
        assert row.summary or row.name in {entry.name for entry in shipped.own()}
        assert shipped.digest(row.name) == "" or row.name in {entry.name for entry in shipped.own()}


def test_a_second_registry_of_a_kind_does_not_take_the_place_of_the_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Registry, "by_kind", Registry.by_kind)
    Registry("agent", "layoutexplore.agents", lambda name, made: made, module=__name__)
    assert Registry.by_kind["agent"] is AGENTS
