"""A registry: what ships and what users add, by name, by `NAME:key=value,...` and by `FILE.py:NAME`.

Agents, predictors and layout methods have one each, of the same shape: a name, a line that says what it does,
a function that builds it from its name and options, and these options with their defaults.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from layoutexplore.errors import ConfigError, OwnCodeError, shortened, unknown_name
from layoutexplore.files.reading import fingerprint, is_file
from layoutexplore.options import check_kind, format_spec, format_value, parse_options
from layoutexplore.plugins.code_digest import digest_of
from layoutexplore.plugins.docstrings import meanings
from layoutexplore.plugins.own_code import Reference, reference_in
from layoutexplore.plugins.signatures import buildable
from layoutexplore.plugins.tracebacks import told

T = TypeVar("T")


class Description(NamedTuple):
    """A row of a table of what there is: name, what it does, and parameters as (key, default, meaning)."""

    name: str
    summary: str
    parameters: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Entry(Generic[T]):
    """What a registry knows by a name.

    Attributes:
        name: Of it.
        doc: What it does, in one line.
        build: Called with the name of what is made (parameters included) and the options.
        options: A frozen dataclass: the options it has unless told otherwise.
        thing: The user's own class, function or object; None for what ships.
        given: Whether the user gave the options; else they follow from the thing's signature.
        digest: Changes with the user's own code; empty for what ships.
    """

    name: str
    doc: str
    build: Callable[[str, Any], T]
    options: Any
    thing: Any = None
    given: bool = False
    digest: str = ""


class Registry(Generic[T]):
    """What can be chosen by name.

    Args:
        kind: What its entries are, in the singular, for messages: "agent".
        group: Entry points of installed packages in which more of them stand.
        accept: Makes of what a user's own code returns what callers expect. Called with the name and it.
        module: The module that makes this registry.
        homes: Modules of what ships by name, imported when it is asked for; the others register themselves.
        inputs: How many parameters of a user's own function are inputs and no options.
    """

    by_kind: Mapping[str, Registry[Any]] = {}
    """Every registry there is."""

    def __init__(
        self,
        kind: str,
        group: str,
        accept: Callable[[str, Any], T],
        *,
        module: str,
        homes: Mapping[str, str] | None = None,
        inputs: int = 0,
    ) -> None:
        self.kind, self.module = kind, module
        self._group, self._accept, self._homes, self._inputs = group, accept, homes or {}, inputs
        self._entries: dict[str, Entry[T]] = {}
        self._installed: dict[str, Entry[T]] | None = None
        # The first of a kind stays: a module may be imported under two names, as test collectors do.
        Registry.by_kind = {kind: self, **Registry.by_kind}

    def ship(self, name: str, doc: str, build: Callable[[str, Any], T], options: Any) -> None:
        """Make known what ships; arguments as `register`.

        Raises:
            ConfigError: The name is taken by something else. (The same thing again changes nothing: a module
                may be imported under two names, as test collectors do.)
        """
        there = self._entries.get(name)
        if there and (_of(there.build), str(there.options)) != (_of(build), str(options)):
            raise self._taken(name)
        self._entries.setdefault(name, Entry(name, doc, build, options))

    def register(self, name: str, doc: str, build: Callable[..., Any], options: Any = None) -> None:
        """Make something of a user's own known by name; the same thing, defined again, replaces what it was.

        Args:
            name: Lower-case words joined by "-".
            doc: What it does, in one line.
            build: Called with the full name and the options. Without options, a class or function whose own
                parameters, all with defaults, are the options.
            options: A frozen dataclass, as a rule a child of `layoutexplore.options.Options`: the options it
                has unless told otherwise.

        Raises:
            ConfigError: The name is taken by something else or is no name, `build` is no code, or the
                parameters can be no options.
        """
        if not isinstance(name, str) or not name or name.split() != [name] or set(name) & set(":,;="):
            raise ConfigError(
                f"{shortened(name)} cannot name an own {self.kind}: a text with no space and none of : , ; ="
            )
        if not isinstance(doc, str):
            raise ConfigError(
                f"own {self.kind} {shortened(name)}: a text says what it does, not {shortened(doc)}"
            )
        self._check_code(build)
        if options is not None and (isinstance(options, type) or not dataclasses.is_dataclass(options)):
            raise ConfigError(
                f"own {self.kind} {shortened(name)}: options are an object of a frozen dataclass, "
                f"not {shortened(options)}"
            )
        there = self._named(name)
        if there and (there.thing is None or _of(there.thing) != _of(build)):
            raise self._taken(name)
        self._entries[name] = self._own_entry(name, doc, build, options)

    def _check_code(self, thing: Any) -> None:
        if not callable(thing) and type(thing).__module__ == "builtins":
            raise ConfigError(
                f"an own {self.kind} is a class, a function or an object of a class, not {shortened(thing)}"
            )

    def _taken(self, name: str) -> ConfigError:
        return ConfigError(f"the {self.kind} {shortened(name)} exists already: give yours another name")

    def register_object(self, thing: Any) -> str:
        """Register a class, function or object of the user's own under its name; the name.

        Raises:
            ConfigError: It is None, a number, a list or alike, has no name, or the name is taken.
        """
        self._check_code(thing)
        given = getattr(thing, "name", None)
        name: str = given if isinstance(given, str) else getattr(thing, "__name__", type(thing).__name__)
        self.remove(name)  # a cell of a notebook that ran again
        self.register(name, _first_line(thing), thing)
        return name

    def make(self, spec: str) -> T:
        """What a text names, with its parameters.

        Raises:
            UnknownNameError: There is no such name or parameter; the closest ones are suggested.
            ConfigError: The text is not of the form, or a value makes no sense.
            OwnCodeError: A user's own code cannot be loaded, or is not what it should be.
        """
        return self.build(*self.find(spec))

    def build(self, entry: Entry[T], options: Any) -> T:
        """What an entry makes with options; errors as `make`."""
        name = format_spec(entry.name, options, entry.options)
        if entry.thing is None:
            return entry.build(name, options)
        try:
            return self._accept(name, entry.build(name, options))
        except ConfigError:
            raise
        except (Exception, SystemExit) as error:
            raise OwnCodeError(f"{self.kind} {name!r} cannot be made:\n{told(error)}") from error

    def find(self, spec: str) -> tuple[Entry[T], Any]:
        """The entry that a text names, and its options; errors as `make`."""
        check_kind(self.kind, spec, str)
        name, _, text = spec.strip().partition(":")
        entry = self._named(name)
        if entry is None and (reference := reference_in(spec.strip())):
            thing = reference.load()
            entry = self._own_entry(reference.text, _first_line(thing), thing, None, reference)
            text = spec.strip()[len(reference.text) + 1 :]
        if entry is None:
            entry = self._of_installed(name)
        if entry is None and name.endswith(".py"):
            raise ConfigError(
                f"{self.kind} {shortened(spec)}: of a file of your own say which class or function, "
                f"{name}:NAME, or {name}:NAME:key=value with parameters"
            )
        if entry is None:
            raise unknown_name(self.kind, name, self.names())
        colon = len(spec.strip()) > len(entry.name)
        return entry, parse_options(self.kind, spec, entry.name, text if colon else None, entry.options)

    def digest(self, spec: str) -> str:
        """Changes with the user's own code that a text names and the files among its options.

        Empty where the text names what ships.
        """
        entry, options = self.find(spec)
        return entry.digest and entry.digest + _digest_of_named_files(options)

    def names(self) -> list[str]:
        """All names: what ships in the order of its registration, then what users have added."""
        return list(dict.fromkeys([*self._homes, *self._entries, *self._packages()]))

    def describe(self) -> list[Description]:
        """Every entry with its parameters, for help pages and tables; what cannot be loaded says so."""
        found = []
        for name in self.names():
            try:
                entry = self.find(name)[0]
                found.append(Description(name, entry.doc, _parameters(entry.options)))
            except OwnCodeError as error:
                found.append(Description(name, str(error).splitlines()[0].rstrip(":"), ()))
        return found

    def remove(self, name: str) -> None:
        """Forget what a user has registered under a name; what ships stays."""
        if name in self._entries and self._entries[name].thing is not None:
            del self._entries[name]

    def own(self) -> list[Entry[T]]:
        """What users have registered in this process."""
        return [entry for entry in self._entries.values() if entry.thing is not None]

    def restore(self, entry: Entry[T]) -> None:
        """Register what `own` has returned in another process; what is there under its name goes."""
        fresh = self._own_entry(entry.name, entry.doc, entry.thing, entry.options if entry.given else None)
        self._entries[entry.name] = dataclasses.replace(fresh, digest=entry.digest)

    def _own_entry(
        self, name: str, doc: str, thing: Any, options: Any, reference: Reference | None = None
    ) -> Entry[T]:
        digest = reference.digest() if reference else digest_of((thing, options))
        if options is not None:
            return Entry(name, doc, thing, options, thing, given=True, digest=digest)
        build, defaults = buildable(thing, f"{self.kind} {shortened(name)}", inputs=self._inputs)
        return Entry(name, doc, build, defaults, thing, digest=digest)

    def _named(self, name: str) -> Entry[T] | None:
        if name in self._homes and name not in self._entries:
            return self._shipped(name)
        return self._entries.get(name)

    def _shipped(self, name: str) -> Entry[T]:
        importlib.import_module(self._homes[name])
        return self._entries[name]

    def _packages(self) -> dict[str, Any]:
        return {point.name: point for point in entry_points(group=self._group)}

    def _of_installed(self, name: str) -> Entry[T] | None:
        """The entry of an installed package's entry point; None where there is none."""
        point = self._packages().get(name)
        if point is None:
            return None
        try:
            thing = point.load()
        except (Exception, SystemExit) as error:
            raise OwnCodeError(
                f"{self.kind} {name!r} of {point.value} cannot be loaded:\n{told(error)}"
            ) from error
        self.register(name, _first_line(thing), thing)
        return self._entries[name]


def _digest_of_named_files(options: Any) -> str:
    """The fingerprint of the files that options name, weights as a rule, behind a space; or nothing."""
    values = [getattr(options, field.name) for field in dataclasses.fields(options)]
    paths = [Path(value) for value in values if isinstance(value, str) and value]
    with suppress(OSError):  # there, but not to be read: the user's code will say so
        files = [path for path in paths if is_file(path)]
        return f" {fingerprint(files)}" if files else ""
    return ""


def _of(thing: Any) -> str:
    """What a class or function is called where it is defined: the same for one that is defined again."""
    inner = getattr(thing, "func", thing)
    return str(getattr(inner, "__qualname__", None) or type(inner).__qualname__)


def _first_line(thing: Any) -> str:
    return (getattr(thing, "__doc__", None) or "").strip().partition("\n")[0].rstrip(".")


def _parameters(options: Any) -> tuple[tuple[str, str, str], ...]:
    known = meanings(type(options))
    return tuple(
        (f.name, format_value(getattr(options, f.name)), f.metadata.get("text") or known.get(f.name, ""))
        for f in dataclasses.fields(options)
    )
