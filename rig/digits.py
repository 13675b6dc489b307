"""Numbers as people read them."""

from __future__ import annotations

import math


def number(value: float, digits: int = 4) -> str:
    """`digits` significant digits, without exponent where that stays readable; `-` for nan."""
    if not math.isfinite(value):
        return "inf" if math.isinf(value) else "-"
    if value == 0.0:
        return "0"
    if not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"


def brief(value: float, digits: int = 4) -> str:
    """As few digits as say it, `digits` at most; thousands in full."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e7 else text
