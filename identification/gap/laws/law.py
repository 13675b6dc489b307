"""What a law is made of: constants, and terms whose coefficients add up. SI throughout.

The library searches on grids relative to the data; a law says the same in newton metres, seconds
and radians per newton metre.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws.flows import Flow
from identification.gap.model.bench import Bench
from identification.gap.model.variants import CALLED, Variant


@dataclass(frozen=True)
class Term:
    """One coefficient of a law: what it is called (its SI unit is fixed by that), and the numbers
    that its shape needs besides (thresholds, times, places)."""

    coefficient: str
    shape: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Law:
    """constants: what all terms share (joint from 0, axis, memory ...)."""

    constants: Mapping[str, Any]
    terms: tuple[Term, ...]


AS_THEY_ARE = "springs as they are"
AS_IT_STANDS = (
    "as_it_stands"  # a constant: of the torques on the arm as it stands (`bench_of_actual_arm`)
)


@dataclass(frozen=True)
class Laws:
    """The law of an effect, whatever shape of it was fitted.

    describe: a variant of the library on its bench -> its law, and (k,) what turns the variant's
        coefficients into those of the law.
    columns: a law on any bench -> one stacked column per term, for a coefficient of one SI unit.
    through_springs: what it does goes through the joints' springs: the law says which springs it
        counts from (`about`), so that it stays the same beside other ones.
    of_session: coefficients of one session that say nothing of the next: chance, or a path without
        a law.
    lasts: whether there is anything of it in another session. What does not last has a law for its
        own course (what to do next is planned with it), and another day the amplifier drifts
        otherwise, the room warms otherwise, the laser is zeroed anew.
    flow: what of a law on a bench takes a loop over the rows: that of many laws can be made in one.
    """

    describe: Callable[[Bench, Variant], tuple[Law, Array]]
    columns: Callable[[Bench, Law], list[Array]]
    through_springs: bool = False
    of_session: tuple[str, ...] = ()
    lasts: bool = True
    flow: Callable[[Bench, Law], Flow] | None = None

    def of(self, bench: Bench, variant: Variant) -> tuple[Law, Array]:
        """The law of a variant on its bench, and (k,) its units in those of the law.

        Raises ValueError for a variant that says too little of itself.
        """
        to_actual = variant.to_actual_bench
        try:
            law, scale = self.describe(bench if to_actual is None else to_actual(bench), variant)
        except KeyError as missing:
            raise ValueError(
                f"{variant.word}, {variant.label}: the library does not say {missing} of this shape"
            ) from missing
        if self.through_springs:
            springs = bench.compliance if variant.about is None else variant.about
            law = replace(law, constants={**law.constants, "about": tuple(springs.tolist())})
        if to_actual is not None:
            law = replace(law, constants={**law.constants, AS_IT_STANDS: True})
        return law, scale

    def rows(self, bench: Bench, law: Law) -> Array:
        """(size, k): stacked columns of the law's terms on this bench, per SI unit."""
        about = law.constants.get("about")
        if about is not None:
            bench = _counted_from(bench, np.array(about))
        columns = self.columns(bench, law)
        return np.column_stack(columns) if columns else np.zeros((bench.layout.size, 0))

    def about_springs(self, bench: Bench, variant: Variant, compliance: Array) -> Variant:
        """The variant of a word whose effect goes through the springs, with these springs (m,)
        instead of the simulated ones; its columns are put into the pool."""
        law, scale = self.of(bench, variant)
        law = replace(law, constants={**law.constants, "about": tuple(compliance.tolist())})
        columns = (self.rows(bench, law) * scale).T
        name = variant.info.get(CALLED, variant.label)
        return replace(
            variant,
            label=f"{name}, {AS_THEY_ARE}",
            columns=tuple(map(bench.add, columns)),
            info={**variant.info, CALLED: name, "compliance": compliance},
        )


def _counted_from(bench: Bench, compliance: Array) -> Bench:
    """The bench with these springs (m,)."""
    return replace(
        bench,
        compliance=compliance,
        elastic=bench.torque * compliance,
        slope=bench.slope_of(compliance),
    )


KEPT, ACROSS, LOST, WORKED = "kept", "kept across poses", "lost between runs", "worked in"
HUNG, ANEW = "under weight", "lost between setups"
HUNG_LOST = "under weight, lost between runs"


def fresh_after(bench: Bench, memory: str) -> Flags:
    """(n,) rows before which the mechanism forgets, for one of the kinds of memory."""
    if memory == ACROSS:
        return np.zeros(bench.rows.n, dtype=bool)
    if memory == ANEW:
        return bench.rebuilt
    if memory in (LOST, HUNG_LOST):
        return np.asarray(bench.moved | bench.rest)
    return bench.moved


def along(bench: Bench, direction: tuple[float, ...]) -> Array:
    """(n,): 1 for rows along that direction, -1 for rows against it, 0 elsewhere."""
    cosine = np.array([float(s.unit_vector @ np.array(direction)) for s in bench.data.setups])
    return np.where(np.abs(cosine) > 0.999, np.sign(cosine), 0.0)[bench.rows.setup]


def in_pose(bench: Bench, pose: str | None) -> Flags:
    """(n,) rows of that pose; all of them where it is None."""
    of_it = np.array([pose in (None, s.pose) for s in bench.data.setups])
    return np.asarray(of_it[bench.rows.setup])


def triple(vector: Array) -> tuple[float, float, float]:
    """A vector (3,) as a law keeps it."""
    x, y, z = (float(v) for v in vector)
    return x, y, z
