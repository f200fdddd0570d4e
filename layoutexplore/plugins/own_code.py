"""A user's own code: `FILE.py:NAME` and `package.module:NAME`, loaded once, and again when a file changes.

While a benchmark runs, its references are pinned: what was loaded when it began is what all its runs get. The
files themselves travel to the workers, unless they are large, so that they may be edited meanwhile.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import linecache
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import cache_from_source, decode_source, find_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from layoutexplore.errors import ConfigError, OwnCodeError, unknown_name
from layoutexplore.files.reading import read_bytes
from layoutexplore.plugins.own_files import digest_of_files, files_of, names_of, own_file
from layoutexplore.plugins.tracebacks import told

# A folder may be called lr=0.1, but "layout-tour:predictor=mine.py:MyRooms" is no file.
_FILE = re.compile(r"(?P<place>[^:]*?\.py|[^=]*?\.py):(?P<name>[A-Za-z_]\w*)(?=:|$)")
_MODULE = re.compile(r"(?P<place>[A-Za-z_]\w*(\.[A-Za-z_]\w*)*):(?P<name>[A-Za-z_]\w*)(?=:|$)")


class Loaded(NamedTuple):
    """A module of a user's own.

    Attributes:
        module: It.
        files: Its file and those that it imports from beside it, as they were when it was loaded.
    """

    module: ModuleType
    files: dict[Path, bytes]

    @property
    def digest(self) -> str:
        """Changes with any of the files."""
        return digest_of_files(self.files)

    @property
    def is_current(self) -> bool:
        """Whether no file has changed since."""
        return all(path.is_file() and path.read_bytes() == data for path, data in self.files.items())


LARGEST_PINNED = 1_000_000
"""Bytes of code that travel with a pin; of more, every process reads the files itself."""


class Pin(NamedTuple):
    """Where a reference leads, in every process of a benchmark.

    Attributes:
        place: The file or module.
        digest: Of what lies there.
        files: What lies there; empty where that is more than `LARGEST_PINNED`.
    """

    place: str
    digest: str
    files: dict[Path, bytes]


_loaded: dict[str, Loaded] = {}
_places: dict[str, str] = {}
_pins: dict[str, Pin] = {}
_folders: list[str] = []
"""Where files of references lie, in `sys.path` for their sake."""


class Reference(NamedTuple):
    """What a text refers to.

    Attributes:
        text: `FILE.py:NAME` or `package.module:NAME`.
        place: The file or module.
        name: Of a class, function or object there.
    """

    text: str
    place: str
    name: str

    def load(self) -> Any:
        """The class, function or object.

        Raises:
            ConfigError: There is no such file, module or name.
            OwnCodeError: The code fails while it is loaded, or is not what a running benchmark began with.
        """
        there = vars(self._loaded().module)
        if self.name not in there:
            known = [name for name, value in there.items() if callable(value) and not name.startswith("_")]
            raise unknown_name(f"name in {self.place}:", self.name, known)
        return there[self.name]

    def digest(self) -> str:
        """Changes with the code that `load` loads."""
        return self._loaded().digest

    def _loaded(self) -> Loaded:
        pin = _pins.get(self.place)
        place = pin.place if pin else self.place
        if place.endswith(".py"):
            key, load = str(_absolute(place)), _execute
        else:
            key, load = place, _import
        there = _loaded.get(key)
        # Python imports a module once.
        stays = there and (there.digest == pin.digest if pin else load is _import or there.is_current)
        if there is None or not stays:
            there = _loaded[key] = load(key, there, pin.files if pin else {})
        elif load is _execute:
            _look_beside(Path(key).parent)  # It may import more while it runs.
        _places[self.place] = key
        if pin and there.digest != pin.digest:
            raise OwnCodeError(f"{self.place} has changed since the benchmark began: give the command again")
        return there


def reference_in(spec: str) -> Reference | None:
    """The reference that a text begins with; None where there is none.

    Example:
        >>> reference_in("strategies/mine.py:MyAgent:size=2").name
        'MyAgent'
        >>> reference_in("nearest:min_size=2")
    """
    if found := _FILE.match(spec):
        return Reference(found.group(), found["place"], found["name"])
    found = _MODULE.match(spec)
    if not found:
        return None
    if "." not in found["place"]:
        with _here_importable():
            if find_spec(found["place"]) is None:
                return None
    return Reference(found.group(), found["place"], found["name"])


def pins() -> dict[str, Pin]:
    """Where all references of this process lead now, by the places that they name."""
    found = {}
    # Where two have read different states of a file beside them, what is there now counts: the last one.
    for place, key in sorted(_places.items(), key=lambda item: _loaded[item[1]].is_current):
        there = _loaded[key]
        small = sum(map(len, there.files.values())) <= LARGEST_PINNED
        found[place] = Pin(key, there.digest, there.files if small else {})
    return found


@contextlib.contextmanager
def pinned(places: Mapping[str, Pin]) -> Iterator[None]:
    """Inside the block, references lead where they led when the pins were made, or to an error.

    So does what their code imports from beside it inside the block.
    """
    before, finder = dict(_pins), _PinnedFinder()
    _pins.update(places)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        _pins.clear()
        _pins.update(before)


class _PinnedFinder(MetaPathFinder):
    """Finds modules whose files came with a pin where they would be found anyway, or were once."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        name = fullname.rpartition(".")[2]
        ours = ((file, data) for pin in _pins.values() for file, data in pin.files.items())
        files = {file: data for file, data in ours if name in (file.stem, file.parent.name)}
        if not files:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.origin:
            homes = list(names_of(Path(spec.origin)))
        elif spec is None:
            stems = [Path(entry).resolve() / name for entry in path or sys.path]
            homes = [home for stem in stems for home in (stem / "__init__.py", Path(f"{stem}.py"))]
        else:
            homes = []
        for home in homes:
            if home in files:
                within = [str(home.parent)] if home.name == "__init__.py" else None
                loader = _PinnedLoader(fullname, str(home), files[home])
                return spec_from_file_location(
                    fullname, home, loader=loader, submodule_search_locations=within
                )
        return None


class _PinnedLoader(SourceFileLoader):
    """Loads a module from bytes that were read before; compiled code of the file as it is now is no use."""

    def __init__(self, name: str, path: str, source: bytes) -> None:
        super().__init__(name, path)
        self._source = source

    def get_data(self, path: str) -> bytes:
        return self._source if path == self.path else super().get_data(path)

    def path_stats(self, path: str) -> dict[str, Any]:
        raise OSError(path)


def _absolute(place: str) -> Path:
    # Links that lead to themselves, and homes of nobody, are left as they are: no file is there.
    return Path(os.path.realpath(os.path.expanduser(place)))  # noqa: PTH111


def _execute(place: str, before: Loaded | None, files: dict[Path, bytes]) -> Loaded:
    """Run a Python file as a module of its own, as it is or as it was; modules beside it can be imported."""
    path = Path(place)
    source = files[path] if path in files else read_bytes(path, ConfigError, "code", limit="text_mb")
    for changed in before.files if before else ():
        _forget(changed)
    _look_beside(path.parent)
    module = ModuleType(f"{path.stem}_{hashlib.sha256(place.encode()).hexdigest()[:8]}")
    module.__file__ = place
    sys.modules[module.__name__] = module  # dataclasses look for their module there

    def run() -> None:
        code = compile(source, place, "exec", dont_inherit=True)
        lines = decode_source(source).splitlines(keepends=True)
        linecache.cache[place] = len(source), None, lines, place  # tracebacks show what ran
        exec(code, vars(module))

    _run(place, run)
    return Loaded(module, files or {**files_of(module), path: source})


def _look_beside(folder: Path) -> None:
    """Let the modules of a folder be imported, before those of one name in the folders of other files."""
    here = str(folder)
    if here not in sys.path:
        sys.path.append(here)
        _folders.append(here)
    if here not in _folders:  # The user's own order stays.
        return
    first = min(sys.path.index(other) for other in _folders if other in sys.path)
    if sys.path[first] == here:
        return
    beside: set[str] = set()
    with contextlib.suppress(OSError):  # a folder that is gone, or that may not be listed
        beside = {path.stem if path.suffix == ".py" else path.name for path in folder.iterdir()}
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] not in beside:
            continue
        file = own_file(module) if isinstance(module, ModuleType) else None
        homes = {str(home) for path in names_of(file) for home in path.parents} if file else set()
        if here not in homes and homes.intersection(_folders):
            del sys.modules[name]
    sys.path.remove(here)
    sys.path.insert(first, here)


def _import(place: str, before: Loaded | None, files: dict[Path, bytes]) -> Loaded:
    """Import a module; one that was imported from other files before is forgotten."""
    for changed in before.files if before else ():
        _forget(changed)
    modules: list[ModuleType] = []
    with _here_importable():
        _run(place, lambda: modules.append(importlib.import_module(place)))
    return Loaded(modules[0], files or files_of(modules[0]))


def _run(place: str, function: Callable[[], None]) -> None:
    try:
        function()
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and place.startswith(error.name or " "):
            raise ConfigError(f"{place}: there is no such module") from error
        raise OwnCodeError(f"{place} cannot be loaded:\n{told(error)}") from error


def _forget(path: Path) -> None:
    """Let a module beside a changed file be imported anew, from its text.

    What Python keeps of it compiled is told from another text of that length by the second of its writing.
    """
    kept = {cache_from_source(path)}
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if isinstance(file, str) and file.endswith(path.name) and path in names_of(Path(file)):
            del sys.modules[name]
            kept.add(cache_from_source(file))
    for compiled in kept:
        with contextlib.suppress(OSError):
            Path(compiled).unlink()


@contextlib.contextmanager
def _here_importable() -> Iterator[None]:
    """Inside the block, modules of the working folder can be imported, after all others."""
    here = str(Path.cwd())
    added = here not in sys.path and "" not in sys.path
    if added:
        sys.path.append(here)
    try:
        yield
    finally:
        if added:
            sys.path.remove(here)
