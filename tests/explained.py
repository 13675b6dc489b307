"""The diagnosis as most tests ask for it: without what to measure next, a tenth of the time."""

from __future__ import annotations

from collections.abc import Iterable

from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.diagnose import explain_gap


def explained(data: GapData, *, withhold: Iterable[str] = (), add: Iterable[str] = ()) -> GapResult:
    """As `diagnose_gap` has it."""
    result, _ = explain_gap(data, withhold=withhold, add=add)
    return result
