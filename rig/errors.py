"""Bad input: one message, exit status 2. (Devices have their own errors in `drivers.errors`.)"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import SequenceMatcher, get_close_matches


class InputError(Exception):
    """Something the user gave is wrong; the text names file, place, value, allowed, next step."""


class MeasurementStopped(Exception):
    """The measurement ended early, for safety or by the operator; data kept. Exit status 4."""


def did_you_mean(word: str, known: Iterable[str], called: Callable[[str], str] = str) -> str:
    """` Did you mean "x"?` for a mistyped word, or the list of known ones. called: what the message
    calls them, where they are compared by less (a file by what stands before its ending)."""
    names = sorted(known)
    if not names:
        return ""
    return close_to(word, names, called) or f" Known: {', '.join(map(called, names))}."


def close_to(word: str, known: Iterable[str], called: Callable[[str], str] = str) -> str:
    """` Did you mean "x"?`, or nothing: for messages that list the known words anyway."""
    meant = closest(word, known)
    return "" if meant is None else f' Did you mean "{called(meant)}"?'


def closest(word: str, known: Iterable[str]) -> str | None:
    """The known word that was probably meant, where one is near enough, and no other as near."""
    near = get_close_matches(word, sorted(known), n=2)
    alike = [SequenceMatcher(None, each, word).ratio() for each in near]
    return None if not near or alike[1:] == alike[:1] else near[0]
