"""A view into the report's JSON that knows where it looks: numbers keep their place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rig.digits import likely, number
from rig.report.document import Inline, Number, Rich

NOTHING = "-"
_LEAST_P = 1e-3  # what is rarer depends on tails that nobody knows
DEGREES = 180 / math.pi  # in a radian: protocols and pendants have degrees


class Node:
    """One place in a JSON document. Missing keys and indices raise KeyError, with the pointer."""

    def __init__(self, value: Any, pointer: str = "") -> None:
        """value: what `json.dumps` takes; pointer: where it stands (RFC 6901)."""
        self.value = value
        self.pointer = pointer

    def __getitem__(self, key: str | int) -> Node:
        """The node below."""
        place = f"{self.pointer}/{escaped(str(key))}"
        try:
            return Node(self.value[key], place)
        except (KeyError, IndexError, TypeError) as error:
            raise KeyError(place) from error

    def get(self, key: str) -> Node:
        """As `[key]`, with the value None where there is none."""
        below = self.value.get(key) if isinstance(self.value, dict) else None
        return Node(below, f"{self.pointer}/{escaped(key)}")

    def __iter__(self) -> Iterator[Node]:
        """The nodes of a list."""
        for i in range(len(self.value or ())):
            yield self[i]

    def items(self) -> Iterator[tuple[str, Node]]:
        """Keys and nodes of an object."""
        for key in self.value or {}:
            yield key, self[key]

    def __bool__(self) -> bool:
        """Whether something stands here: null, empty lists and objects are nothing."""
        return self.value not in (None, [], {}, "")

    def number(self, digits: int = 4, scale: float = 1.0, unit: str = "") -> Rich:
        """The number that stands here, to `digits` significant digits; a dash for null."""
        value = self.value
        if value is None:
            return (NOTHING,)
        if isinstance(value, int) and scale == 1.0:
            shown: Inline = Number(str(value), value, self.pointer)
        else:
            shown = Number(number(value * scale, digits), value, self.pointer, scale)
        return (shown, f" {unit}") if unit else (shown,)

    def stated(self, scale: float = 1.0) -> Rich:
        """A number that somebody wrote down, with the digits it was written with."""
        if self.value is None:
            return (NOTHING,)
        return (Number(f"{self.value * scale:.10g}", self.value, self.pointer, scale),)

    def percent(self, digits: int = 3) -> Rich:
        """A share as percent; 0 and 100 stand for what is nearer to them than 0.05."""
        if self.value is None:
            return (NOTHING,)
        shown = 100.0 * self.value
        nearly = abs(shown - round(shown)) < 0.05 and round(shown) in (0, 100)
        text = f"{abs(round(shown))}" if nearly else number(shown, digits)
        return (Number(text, self.value, self.pointer, 100.0), " %")

    def share(self) -> Rich:
        """A share of what is there: what rounds to nothing is still some of it."""
        if self.value is None or round(100.0 * self.value) > 0:
            return self.percent()
        return (Number("< 1", self.value, self.pointer, 100.0), " %")

    def probability(self) -> Rich:
        """A probability as percent, as the terminal tells it: nothing is certain, nor excluded."""
        if self.value is None:
            return (NOTHING,)
        shown = likely(self.value).removesuffix(" %")
        return (Number(shown, self.value, self.pointer, 100.0), " %")

    def chance(self) -> Rich:
        """A p value; none is nil."""
        if self.value is not None and self.value < _LEAST_P:
            return (Number(f"< {_LEAST_P:g}", self.value, self.pointer),)
        return self.number(2)

    def interval(self, digits: int = 4) -> Rich:
        """`low to high` of a pair."""
        low, high = self[0].number(digits), self[1].number(digits)
        return (*low, " to ", *high)

    def text(self) -> str:
        """The text that stands here, a dash for null."""
        return NOTHING if self.value is None else str(self.value)


def escaped(key: str) -> str:
    """A key as a step of a JSON pointer."""
    return key.replace("~", "~0").replace("/", "~1")


def quantity(node: Node, scale: float = 1.0) -> Rich:
    """`value [low, high]` of a quantity with its 95 % interval."""
    if node["value"].value is None:
        return ("undefined",)
    low, high = node["ci95"][0], node["ci95"][1]
    value = node["value"].number(4, scale)
    return (*value, " [", *low.number(4, scale), ", ", *high.number(4, scale), "]")
