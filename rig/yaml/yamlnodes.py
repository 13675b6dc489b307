"""YAML text to plain values that know their line and column, by the rules of YAML 1.2."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from rig.errors import InputError
from rig.yaml import yamlwords as words

Key = words.Path
Place = tuple[int, int]  # line and column, from 1

MAX_VALUES = 100_000
MAX_SHOWN = 30

PLAIN_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_PLAIN_INT = re.compile(r"[-+]?[0-9]+")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_TOO_DEEP = re.compile(r"(?:[\[{]\s*){100}")  # found at once; the parser needs seconds for it
_NULLS = ("", "~", "null", "Null", "NULL")
_BOOLS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_CORE_TAGS = frozenset(
    f"tag:yaml.org,2002:{t}"
    for t in ("str", "int", "float", "bool", "null", "map", "seq", "merge", "timestamp", "value")
)

# Part of the parser's sentence -> what it means to somebody who writes these files.
_SYNTAX = (
    ("'\\t'", "a tab stands here; indent with spaces"),
    (
        "mapping values are not allowed",
        "a colon where none can stand; check the indentation of "
        "this line and the one above, or quote the text",
    ),
    ("could not find expected ':'", "a key without a colon and value"),
    ("did not find expected key", "the indentation of this line fits no line above"),
    ("expected <block end>", "the indentation of this line fits no line above"),
    ("expected ',' or", "a bracket opened before is not closed, or a comma is missing"),
    ("unexpected end of stream", "the text in quotes is not closed"),
    ("expected the node content", "a bracket is not closed, or a value is missing"),
    ("undefined alias", "an alias (*name) without an anchor (&name) before it"),
    ("a single document", "a second document (---) begins; one file holds one document"),
    ("cannot start any token", "a character that cannot start a value; quote the text"),
)


@dataclass(frozen=True, order=True)
class Problem:
    """One thing wrong in a file; `line` and `column` count from 1, 0 where there is none."""

    line: int
    column: int
    text: str


def refuse(name: str, problems: Sequence[Problem], *, more: bool = False) -> NoReturn:
    """Raises one InputError with a line per problem, in the order of the file. more: there is more
    to check, which needs what is wrong."""
    ordered = sorted(problems)
    lines = [f"{address(name, p)}: {p.text}" for p in ordered[:MAX_SHOWN]]
    if len(ordered) > MAX_SHOWN:
        lines.append(f"{name}: and {len(ordered) - MAX_SHOWN} more problems.")
    if more:
        lines.append(f"{name}: whether its values fit each other is checked once that is mended.")
    raise InputError("\n".join(lines))


def address(name: str, problem: Problem) -> str:
    """Where a problem is: `FILE:LINE:COLUMN`, as far as that is known."""
    if not problem.line:
        return name
    return f"{name}:{problem.line}:{problem.column}" if problem.column else f"{name}:{problem.line}"


def compose(text: str, name: str) -> Node:
    """The node tree of one document; raises InputError for text that is no YAML."""
    if _TOO_DEEP.search(text):
        raise InputError(f"{name}: nested too deeply.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            node = YAML(typ="safe", pure=True).compose(text)
    except MarkedYAMLError as error:
        refuse(name, [_syntax_problem(error)])
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        refuse(name, [Problem(line, 0, "a control character; only text may stand here.")])
    except RecursionError:
        raise InputError(f"{name}: nested too deeply.") from None
    except (YAMLError, ValueError) as error:
        raise InputError(f"{name}: not readable as YAML: {error}.") from error
    if node is None:
        raise InputError(f"{name}: empty; `key: value` lines are wanted.")
    assert isinstance(node, Node)
    return node


def _syntax_problem(error: MarkedYAMLError) -> Problem:
    mark = error.problem_mark or error.context_mark
    said = f"{error.problem or ''} {error.context or ''}".strip()
    meaning = next((means for part, means in _SYNTAX if part in said), said)
    opened = error.context_mark
    if opened is not None and mark is not None and opened.line != mark.line:
        meaning += f" (it belongs to what begins in line {opened.line + 1})"
    if mark is None:
        return Problem(0, 0, f"not YAML: {meaning}.")
    return Problem(mark.line + 1, mark.column + 1, f"not YAML: {meaning}.")


class Reader:
    """Nodes to plain values, with the place of each and the problems on the way.

    `places` maps paths to where their values begin, `keys` to where their keys do; `bad` are the
    paths that have a problem already. An instance reads one document.
    """

    def __init__(self) -> None:
        self.places: dict[Key, Place] = {}
        self.keys: dict[Key, Place] = {}
        self.problems: list[Problem] = []
        self.bad: set[Key] = set()
        self._open: list[int] = []

    def read(self, node: Node) -> object:
        """Plain value of the document: dict, list, str, int, float, bool or None."""
        return self._value(node, (), _place(node))

    def complain(self, path: Key, at: Place, what: str) -> None:
        """Notes a problem; later ones at the same path would only repeat it."""
        self.bad.add(path)
        where = words.place(path)
        self.problems.append(Problem(*at, f"{where}: {what}" if where else what))

    def is_bad(self, path: Key) -> bool:
        """True where the value at `path`, or one that contains it, has a problem already."""
        return any(path[:n] in self.bad for n in range(1, len(path) + 1))

    def rename(self, path: Key, name: str) -> None:
        """From now on the value at `path` is also known under another key beside it."""
        n = len(path)
        for places in (self.places, self.keys):
            below = [p for p in places if p[:n] == path]
            places.update({(*path[:-1], name, *p[n:]): places[p] for p in below})

    def _value(self, node: Node, path: Key, at: Place) -> object:
        self.places[path] = at
        if node.tag not in _CORE_TAGS:
            self.complain(path, at, f"the tag {node.tag} is not allowed; write plain values.")
            return None
        if id(node) in self._open or len(self.places) > MAX_VALUES:
            self.complain(path, at, "an alias (*name) inside its own anchor, or too many of them.")
            return None
        if isinstance(node, ScalarNode):
            return self._scalar(node, path, at)
        self._open.append(id(node))
        try:
            if isinstance(node, SequenceNode):
                return [self._value(n, (*path, i), _place(n)) for i, n in enumerate(node.value)]
            return self._mapping(node, path)
        finally:
            self._open.pop()

    def _mapping(self, node: Node, path: Key) -> dict[str, object]:
        result: dict[str, object] = {}
        for key_node, value_node in node.value:
            at = _place(key_node)
            if not isinstance(key_node, ScalarNode):
                self.complain((*path, "?"), at, "a list or mapping as key; keys are words.")
            elif key_node.tag == "tag:yaml.org,2002:merge":
                what = "a merge key is no YAML 1.2; write the keys out."
                self.complain((*path, "<<"), at, what)
            elif key_node.value in result:
                first = self.keys[(*path, key_node.value)][0]
                what = f"stands twice (first in line {first}); keep one."
                self.complain((*path, key_node.value), at, what)
            else:
                below = (*path, str(key_node.value))
                self.keys[below] = at
                empty = isinstance(value_node, ScalarNode) and not value_node.value
                result[key_node.value] = self._value(
                    value_node, below, at if empty else _place(value_node)
                )
        return result

    def _scalar(self, node: ScalarNode, path: Key, at: Place) -> object:
        text = str(node.value)
        if node.style is not None:
            return text
        if text in _NULLS:
            return None
        if text in _BOOLS:
            return _BOOLS[text]
        if _PLAIN_INT.fullmatch(text) and len(text) < 18:
            return int(text)
        if _NOT_FINITE.fullmatch(text):
            self.complain(path, at, f"{text} is not a finite number.")
            return 0.0
        if PLAIN_NUMBER.fullmatch(text):
            number = float(text)
            if abs(number) < 1e300:
                return number
            self.complain(path, at, f"{text[:40]} is too large a number.")
            return 0.0
        return text


def _place(node: Node) -> Place:
    mark = node.start_mark
    return (mark.line + 1, mark.column + 1) if mark is not None else (0, 0)
