"""What parameters mean stands in docstrings."""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.plugins.docstrings import meanings


@dataclass
class Base:
    """A base.

    Attributes:
        size: Metres; a long
            sentence: with a colon.
    """

    size: float = 1.0


class Child(Base):
    """A child."""

    def __init__(self, size: float = 1.0, word: str = "x") -> None:
        """Make it.

        Args:
            word: Something.

        Returns:
            nothing: That is no parameter.
        """


def test_bases_and_constructors_count() -> None:
    assert meanings(Child) == {"word": "Something", "size": "Metres; a long sentence: with a colon"}
    assert meanings(test_bases_and_constructors_count) == {}
