"""Numbers as people read them."""

from __future__ import annotations

import math


def number(value: float, digits: int = 4, beside: float = 1.0) -> str:
    """`digits` significant digits, without exponent where that stays readable; `-` for nan.
    beside: another value of the same quantity, whose exponent this one has too."""
    if not math.isfinite(value):
        return "inf" if math.isinf(value) else "-"
    if value == 0.0:
        return "0"
    if _needs_exponent(value) or _needs_exponent(beside):
        return f"{value:.{digits - 1}e}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"


def _needs_exponent(value: float) -> bool:
    return value != 0.0 and math.isfinite(value) and not 1e-4 <= abs(value) < 1e7


def counted(count: int, word: str) -> str:
    """`1 row`, `2 rows`."""
    return f"{count} {word}{'' if count == 1 else 's'}"


def brief(value: float, digits: int = 4) -> str:
    """As few digits as say it, `digits` at most; thousands in full."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e7 else text


def likely(p: float) -> str:
    """A probability as percent; nothing is certain, nor excluded."""
    whole = round(100 * p)
    return "> 99 %" if whole == 100 else "< 1 %" if whole == 0 else f"{whole} %"
