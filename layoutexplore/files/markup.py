"""XML: a tree of elements within limits; document types and entities are refused."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from xml.parsers import expat

from layoutexplore.errors import MapError, shortened
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.files.reading import Kind, read_bytes


def read_xml(path: Path, *, error: Kind = MapError, what: str = "floor plan") -> ElementTree.Element:
    """The root element of an XML file.

    Raises:
        LayoutExploreError: Of the kind `error`: it cannot be read, is no XML, defines entities, or is deeper
            or larger than the limits.
    """
    data = read_bytes(path, error, what, limit="text_mb")
    tree = _Tree(path, error)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler = tree.builder.data
    parser.StartDoctypeDeclHandler = tree.refuse
    try:
        parser.Parse(data, True)
        return tree.builder.close()
    except error:
        raise
    except Exception as problem:  # expat's own, and those of encodings that Python does not know
        raise error(f"{path}: not readable as XML: {shortened(str(problem))}") from problem


class _Tree:
    """What is built while the parser reads.

    Args:
        path: The file, for messages.
        error: What is raised.
    """

    def __init__(self, path: Path, error: Kind) -> None:
        self.builder = ElementTree.TreeBuilder()
        self._path, self._error = path, error
        self._depth = self._count = 0
        self._limits = limits()  # asked once: there are millions of elements

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self._depth += 1
        self._count += 1 + len(attributes)
        most = self._limits
        if self._depth > most.depth:
            raise self._error(f"{self._path}: elements are deeper than the limit depth, {most.depth:g}")
        if self._count > most.nodes:
            raise self._error(
                f"{self._path}: more elements and attributes than the limit nodes, {most.nodes:g}: "
                f"{raise_it('nodes', 2 * most.nodes)}"
            )
        self.builder.start(name, attributes)

    def end(self, name: str) -> None:
        """An element ends."""
        self._depth -= 1
        self.builder.end(name)

    def refuse(self, *_: object) -> None:
        """A document type begins: it could define entities that grow without limit."""
        raise self._error(f"{self._path}: a document type (<!DOCTYPE>) is not read: remove it")
