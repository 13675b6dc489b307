"""Effects in absolute units: what was fitted on one measurement, carried over to any other.

The library searches on grids relative to the data. A `Form` is the same law in newton metres,
seconds and radians per newton metre; `describe` makes it from a fitted part, `realise` gives what
it does on another bench. On the bench that it came from, it is the fitted contribution again, but
for instruments that read what other effects do (`search.readings`): their form is that of the
springs alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from identification.arrays import Array
from identification.gap.effects import EFFECTS
from identification.gap.evidence.parts import Part
from identification.gap.laws.actual_arm import LawValues, bench_of_actual_arm
from identification.gap.laws.law import AS_IT_STANDS, Law
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant


@dataclass(frozen=True, eq=False)
class Form:
    """An effect with numbers: values (k,) of the law's terms in SI units, covariance (k, k)."""

    word: str
    law: Law
    values: Array
    covariance: Array

    @property
    def acts(self) -> LawValues:
        """What it does, its numbers taken as they are."""
        return LawValues(self.law, self.values)


def law_of(bench: Bench, variant: Variant) -> tuple[Law, Array]:
    """The law of a variant of the library on its bench, and (k,) its units in those of the law.

    Raises ValueError for a variant that says too little of itself.
    """
    return EFFECTS[variant.word].laws.of(bench, variant)


def describe(bench: Bench, part: Part, w: Array, covariance: Array) -> Form:
    """The form of a fitted part; w (k,), covariance (k, k): of the variant's coefficients."""
    law, scale = law_of(bench, part.variant)
    return Form(part.word, law, w * scale, covariance * np.outer(scale, scale))


def rows_of(bench: Bench, word: str, law: Law, beside: Iterable[Form] = ()) -> Array:
    """(size, k): stacked columns of the law's terms on this bench, per SI unit. beside: effects of
    the same rig, which may change the torques that the law is of."""
    return EFFECTS[word].laws.rows(where_it_acts(bench, law, beside), law)


def where_it_acts(bench: Bench, law: Law, beside: Iterable[Form]) -> Bench:
    """The bench of the torques that a law is of: as effects beside it leave them, if it says so."""
    if not law.constants.get(AS_IT_STANDS):
        return bench
    return bench_of_actual_arm(bench, (form.acts for form in beside))


def realise(bench: Bench, form: Form, beside: Iterable[Form] = ()) -> Array:
    """(size,): what the effect adds to every channel of this bench. beside: as there."""
    return np.asarray(rows_of(bench, form.word, form.law, beside) @ form.values)


def lawful(form: Form) -> Form:
    """The form without the coefficients that say nothing of another procedure."""
    of_session = EFFECTS[form.word].laws.of_session
    return _of_terms(form, [t.coefficient not in of_session for t in form.law.terms])


def lasting(form: Form) -> Form:
    """The form with what the arm and the instruments still do in another session; of a drift, of
    jumps of the datum and of what single runs have to themselves nothing is left."""
    laws = EFFECTS[form.word].laws
    keep = [
        laws.lasts and t.coefficient not in laws.of_session and "run" not in t.shape
        for t in form.law.terms
    ]
    return _of_terms(form, keep)


def _of_terms(form: Form, keep: list[bool]) -> Form:
    mine = np.flatnonzero(keep)
    law = Law(form.law.constants, tuple(form.law.terms[i] for i in mine))
    return replace(
        form, law=law, values=form.values[mine], covariance=form.covariance[np.ix_(mine, mine)]
    )
