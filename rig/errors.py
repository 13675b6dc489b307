"""Bad input: one message, exit status 2. (Devices have their own errors in `drivers.errors`.)"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(Exception):
    """Something the user gave is wrong; the text names file, place, value, allowed, next step."""


class MeasurementStopped(Exception):
    """The measurement ended early, for safety or by the operator; data kept. Exit status 4."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """` Did you mean "x"?` for a mistyped word, or the list of known ones."""
    names = sorted(known)
    return close_to(word, names) or " Known: " + ", ".join(names) + "."


def close_to(word: str, known: Iterable[str]) -> str:
    """` Did you mean "x"?`, or nothing: for messages that list the known words anyway."""
    close = get_close_matches(word, sorted(known), n=1)
    return f' Did you mean "{close[0]}"?' if close else ""
