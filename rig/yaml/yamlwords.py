"""Plain words for what stands in a YAML file and for what may stand there (JSON schema)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

Path = tuple[str | int, ...]
Schema = Mapping[str, object]

_UNITS = (
    "N",
    "Nm",
    "m",
    "mm",
    "um",
    "s",
    "min",
    "Hz",
    "kHz",
    "rad",
    "deg",
    "C",
    "K",
    "V",
    "A",
    "kg",
    "m3",
    "pC",
    "Pa",
    "GPa",
    "percent",
    "s2",
    "kgm2",
)
_UNIT = re.compile(r"(?:^|[_0-9])(?P<first>{0})(?:_per_(?P<second>{0}))?$".format("|".join(_UNITS)))
_SPELLED = {"C": "deg C", "percent": "%", "s2": "s^2", "m3": "m^3", "kgm2": "kg m^2"}


def unit_of(path: Path) -> str:
    """Unit that the innermost key with a unit suffix states, `N/s` for `..._N_per_s`; or ""."""
    for key in reversed(path):
        match = _UNIT.search(key) if isinstance(key, str) and "_" in key else None
        if match:
            words = [_SPELLED.get(u, u) for u in match.groups() if u]
            return "/".join(words)
    return ""


def place(path: Path) -> str:
    """`runs[2].direction` for ("runs", 2, "direction")."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            text += f".{key}" if text else key
    return text


def with_unit(number: object, unit: str) -> str:
    """A number as written in messages: `12.5 mm`."""
    text = f"{number:.10g}" if isinstance(number, float) else str(number)
    return f"{text} {unit}".rstrip()


def value_words(value: object, unit: str) -> str:
    """What the file holds, short: a number with its unit, quoted text, `a list of 3`."""
    if value is None:
        return "empty (null)"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return with_unit(value, unit)
    if isinstance(value, str):
        return f'the text "{value[:40]}{"..." if len(value) > 40 else ""}"'
    if isinstance(value, Sequence):
        return f"a list of {len(value)}" if value else "an empty list"
    return "a mapping" if value else "an empty mapping"


def resolve(schema: Schema, node: Schema) -> Iterator[Schema]:
    """The alternatives that a schema node stands for, references followed."""
    reference = node.get("$ref")
    if isinstance(reference, str):
        definitions = schema.get("$defs")
        assert isinstance(definitions, Mapping)
        yield from resolve(schema, definitions[reference.removeprefix("#/$defs/")])
        return
    for word in ("anyOf", "oneOf"):
        options = node.get(word)
        if isinstance(options, Sequence):
            for option in options:
                yield from resolve(schema, option)
            return
    yield node


def _child(node: Schema, key: str | int) -> object:
    if isinstance(key, int):
        fixed = node.get("prefixItems")
        if isinstance(fixed, Sequence) and key < len(fixed):
            return fixed[key]
        return node.get("items")
    properties = node.get("properties")
    if isinstance(properties, Mapping) and key in properties:
        return properties[key]
    return node.get("additionalProperties")


def schemas_at(schema: Schema, path: Path) -> list[Schema]:
    """The alternatives allowed at a path of the file; empty for an unknown place."""
    nodes = list(resolve(schema, schema))
    for key in path:
        children = [_child(node, key) for node in nodes]
        nodes = [n for c in children if isinstance(c, Mapping) for n in resolve(schema, c)]
    return nodes


def known_keys(nodes: Sequence[Schema]) -> list[str]:
    """The keys that a mapping may have here."""
    found = (node.get("properties") for node in nodes)
    return list(dict.fromkeys(k for p in found if isinstance(p, Mapping) for k in p))


def allowed_words(schema: Schema, nodes: Sequence[Schema], unit: str) -> str:
    """What may stand here, in one phrase: `a number above 0 mm or null`."""
    words = dict.fromkeys(_allowed(schema, node, unit) for node in nodes)
    return " or ".join(w for w in words if w)


def _allowed(schema: Schema, node: Schema, unit: str) -> str:
    if "const" in node:
        return _constant(node["const"], unit)
    options = node.get("enum")
    if isinstance(options, Sequence):
        most = [_constant(o, "") for o in options[:-1]]
        last = _constant(options[-1], unit)
        return f"{', '.join(most)} or {last}" if most else last
    kind = node.get("type")
    if kind in ("number", "integer"):
        return _numbers(node, unit)
    if kind == "array":
        return _list(schema, node, unit)
    if kind == "string":
        return "text (not empty)" if node.get("minLength") else "text"
    keys = node.get("required")
    mapping = f"a mapping with {', '.join(keys)}" if isinstance(keys, list) else "a mapping"
    return {"boolean": "true or false", "null": "null", "object": mapping}.get(str(kind), "")


def _constant(value: object, unit: str) -> str:
    return f'"{value}"' if isinstance(value, str) else with_unit(value, unit)


def _numbers(node: Schema, unit: str) -> str:
    noun = "a whole number" if node.get("type") == "integer" else "a number"
    low, high = node.get("minimum"), node.get("maximum")
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f"{noun} from {with_unit(low, '')} to {with_unit(high, unit)}"
    bounds = [
        f"{word} {with_unit(bound, unit)}"
        for word, bound in (
            ("of at least", low),
            ("above", above),
            ("of at most", high),
            ("below", below),
        )
        if bound is not None
    ]
    if bounds:
        return f"{noun} {' and '.join(bounds)}"
    return f"{noun} in {unit}" if unit else noun


def _list(schema: Schema, node: Schema, unit: str) -> str:
    fixed = node.get("prefixItems")
    if isinstance(fixed, Sequence):
        return f"a list of {len(fixed)} values"
    items = node.get("items")
    inner: list[Schema] = []
    if isinstance(items, Mapping):
        inner = list(resolve(schema, items))
    numbers = bool(inner) and all(n.get("type") in ("number", "integer") for n in inner)
    noun = f"numbers in {unit}" if numbers and unit else "numbers" if numbers else "values"
    low, high = node.get("minItems"), node.get("maxItems")
    if low is not None and low == high:
        return f"a list of {low} {noun}"
    return f"a list of {noun}, at least {low}" if low else f"a list of {noun}"
