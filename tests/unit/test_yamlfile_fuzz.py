"""Broken protocols and stations, made from the good ones: one message that names the file, always.

A mutation may happen to leave a valid file (a limit dropped, a longer hold); those are counted and
must stay few, or the fuzz would prove nothing.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from rig.errors import InputError
from rig.protocol import load_protocol
from rig.station import load_station

PROTOCOLS = Path(__file__).parents[2] / "protocols"
FILES = sorted(PROTOCOLS.glob("*.yaml")) + sorted(PROTOCOLS.glob("stations/*.yaml"))
SEEDS = range(120)
JARGON = ("pydantic", "Traceback", "errors.", "validation error", "type=", "tag:yaml", "http")
WRONG = (
    None,
    True,
    -1,
    0,
    1e12,
    "three",
    "1,5",
    [],
    {},
    [1, "x"],
    {"a": {"b": 1}},
    "",
    "nan",
    "yes",
    [[[]]],
    -0.001,
    "\u00b5",
    "x" * 10_000,
)


def containers(data: Any) -> list[Any]:
    """Every mapping and list of the file that holds something."""
    if not isinstance(data, dict | list) or not data:
        return []
    inner = data.values() if isinstance(data, dict) else data
    return [data, *(c for v in inner for c in containers(v))]


def delete(data: Any, rng: random.Random) -> None:
    at = rng.choice(containers(data))
    del at[rng.choice(list(at)) if isinstance(at, dict) else rng.randrange(len(at))]


def rename(data: Any, rng: random.Random) -> None:
    at = rng.choice([c for c in containers(data) if isinstance(c, dict)])
    key = rng.choice(list(at))
    letters = list(key)
    letters[rng.randrange(len(letters))] = rng.choice("abcxyz_ 0")
    at["".join(letters)] = at.pop(key)


def replace(data: Any, rng: random.Random) -> None:
    at = rng.choice(containers(data))
    key = rng.choice(list(at)) if isinstance(at, dict) else rng.randrange(len(at))
    at[key] = deepcopy(rng.choice(WRONG))


def swap(data: Any, rng: random.Random) -> None:
    at, other = rng.choice(containers(data)), rng.choice(containers(data))
    keys = [
        rng.choice(list(c)) if isinstance(c, dict) else rng.randrange(len(c)) for c in (at, other)
    ]
    at[keys[0]] = str(other[keys[1]])


def cut(text: str, rng: random.Random) -> bytes:
    return text.encode()[: rng.randrange(len(text.encode()) * 9 // 10)]


def flip(text: str, rng: random.Random) -> bytes:
    raw = bytearray(text.encode())
    for _ in range(rng.randint(5, 40)):
        raw[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
    return bytes(raw)


def tabs(text: str, rng: random.Random) -> bytes:
    lines = text.splitlines()
    indented = [i for i, line in enumerate(lines) if line.startswith("  ")]
    lines[rng.choice(indented)] = "\tx: 1"
    return "\n".join(lines).encode()


def double(text: str, rng: random.Random) -> bytes:
    lines = text.splitlines()
    keys = [i for i, line in enumerate(lines) if line[:1].isalpha() and not line.endswith(":")]
    lines.insert(rng.choice(keys), lines[rng.choice(keys)])
    return "\n".join(lines).encode()


def shuffle(text: str, rng: random.Random) -> bytes:
    lines = [line for line in text.splitlines() if line.strip()]
    i = rng.randrange(len(lines))
    lines[i] = "   " * rng.randint(1, 3) + lines[i].strip()
    rng.shuffle(lines)
    return "\n".join(lines).encode()


OF_DATA: tuple[Callable[[Any, random.Random], None], ...] = (delete, rename, replace, swap)
OF_TEXT: tuple[Callable[[str, random.Random], bytes], ...] = (cut, flip, tabs, double, shuffle)


def mutant(seed: int, to: Path) -> tuple[Path, bool]:
    """Writes the broken file of a seed; True if it was a station."""
    rng = random.Random(seed)
    source = FILES[seed % len(FILES)]
    text = source.read_text("utf-8")
    path = to / f"broken{seed}.yaml"
    mutate = rng.choice(OF_DATA + OF_TEXT)
    if mutate in OF_TEXT:
        path.write_bytes(mutate(text, rng))  # type: ignore[arg-type,call-arg]
    else:
        data = YAML(typ="safe", pure=True).load(text)
        for _ in range(rng.randint(1, 4)):
            mutate(data, rng)  # type: ignore[arg-type,call-arg]
        with path.open("w") as file:
            YAML(typ="safe", pure=True).dump(data, file)
    return path, source.parent.name == "stations"


def outcome(seed: int, to: Path) -> str:
    """The message of the one InputError, or "" for a file that is still valid."""
    path, is_station = mutant(seed, to)
    try:
        if is_station:
            load_station(str(path))
        else:
            load_protocol(path)
    except InputError as error:
        message = str(error)
        assert all(line.startswith(str(path)) for line in message.splitlines()), message
        assert not any(word in message for word in JARGON), message
        assert max(map(len, message.splitlines())) < 500 + len(str(path)), message
        return message
    return ""


@pytest.mark.parametrize("block", range(10))
def test_every_broken_file_is_refused_with_one_message(block: int, tmp_path: Path) -> None:
    seeds = SEEDS[block::10]
    valid = [seed for seed in seeds if not outcome(seed, tmp_path)]
    assert len(valid) <= len(seeds) // 5, valid


def test_unbroken_files_are_valid() -> None:
    for file in FILES:
        load_station(str(file)) if file.parent.name == "stations" else load_protocol(file)
