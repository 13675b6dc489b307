"""What rooms of the diagnosis may know of a variant: its properties, not the facts of its law."""

from __future__ import annotations

import re
from pathlib import Path

GAP = Path(__file__).parents[2] / "identification" / "gap"
OWN = ("effects", "laws")  # where a law's facts are given, and read


def test_facts_of_a_law_are_read_by_its_own_effect_and_the_variant_only() -> None:
    others = [
        p
        for p in GAP.rglob("*.py")
        if p.relative_to(GAP).parts[0] not in OWN and p.name != "variants.py"
    ]
    assert len(others) > 50
    told = [p.name for p in others if re.search(r"\.info\b", p.read_text(encoding="utf-8"))]
    assert told == []  # ask for a property
