"""Shapes that one explanation found for a word, lent to others that have it, too."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.evidence.compare import marginal, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, explain, up_to_likeliest
from identification.gap.model.variants import Variant, variant
from identification.gap.search import search
from tests.unit.test_gap_cross_validation import BUMP, REPETITIONS, engine

LAW, BESIDE, NEARLY = "contact_seating", "zero_shift", "base_compliance"


def setting() -> tuple[Engine, dict[str, Variant]]:
    """A bump, its true shape and one that is off, beside a wave and one that is nearly that."""
    e = engine(np.full(REPETITIONS, BUMP))
    load, n, out = e.bench.load, e.bench.rows.n, {}
    wave, other = np.sin(load / 12), np.cos(load / 7)
    shapes = {
        "true": (LAW, np.exp(-(((load - 80) / 25) ** 2))),
        "off": (LAW, np.exp(-(((load - 95) / 25) ** 2))),
        "wave": (BESIDE, wave),
        "nearly": (NEARLY, wave + 0.2 * other),
    }
    for name, (word, shape) in shapes.items():
        out[name] = variant(word, name, [e.bench.add(e.bench.stacked(shape))], (BUMP,))
    target = e.target.copy()
    target[:n] += BUMP * wave
    return Engine(e.bench, e.base, target, e.etas), out


def pair(e: Engine, first: Variant, second: Variant) -> Explanation:
    levels, energy = up_to_likeliest(e, (Part(first, BUMP),))
    scored = score(e, levels, [second], energy)
    return explain(e, (Part(first, BUMP), Part(second, BUMP)), marginal(scored), energy)


def labels(explanation: Explanation) -> set[str]:
    return {p.variant.label for p in explanation.parts}


def test_a_shape_that_does_better_here_too_is_taken() -> None:
    e, v = setting()
    start, found = pair(e, v["off"], v["wave"]), pair(e, v["true"], v["nearly"])
    taken = search._with_lent_shapes(e, list(v.values()), start, [found])
    assert labels(taken) == {"true", "wave"}
    assert taken.log_weight > start.log_weight + 10


def test_nothing_is_polished_for_a_shape_that_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    e, v = setting()
    monkeypatch.setattr(search, "polished", lambda *_: pytest.fail("there was no need"))
    start = pair(e, v["true"], v["wave"])
    for found in (pair(e, v["off"], v["nearly"]), pair(e, v["true"], v["nearly"])):
        assert search._with_lent_shapes(e, list(v.values()), start, [found]) is start


def test_those_that_are_not_looked_at_closely_are_lent_what_the_first_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    e, v = setting()
    first, second = pair(e, v["off"], v["nearly"]), pair(e, v["off"], v["wave"])
    grown = {x.words: x for x in (first, second)}
    monkeypatch.setattr(search, "_with_one_more", lambda *_: grown)
    alone = explain(e, (Part(v["off"], BUMP),), 0.0)
    pool = {alone.words: alone}
    ranked = sorted(grown.values(), key=lambda x: -x.log_weight)
    search._deepen(e, list(v.values()), pool, [alone], 2, 1, set())  # one is looked at closely
    assert labels(pool[ranked[0].words]) >= {"true"}
    assert labels(pool[ranked[1].words]) >= {"true"}
