"""Effects in absolute units: what was fitted on one measurement, carried over to any other.

The library searches on grids relative to the data. A `Form` is the same law in newton metres,
seconds and radians per newton metre; `describe` makes it from a fitted part, `realise` gives what
it does on another bench. On the bench that it came from, it is the fitted contribution again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.forms import elastic, friction, instruments, knees
from identification.gap.forms.law import Columns, Describe, Law, Term
from identification.gap.parts import Part
from identification.gap.variants import Variant
from identification.gap.words import DRIFTS

__all__ = [
    "OF_SESSION",
    "SESSION",
    "Form",
    "Law",
    "Term",
    "about_springs",
    "describe",
    "lasting",
    "law_of",
    "lawful",
    "realise",
    "rows_of",
]

_TABLE: dict[str, tuple[Describe, Columns]] = {
    "joint_yield": (knees.describe, knees.columns),
    "base_slip": (knees.describe, knees.columns),
    "joint_hysteresis": (friction.describe_hysteresis, friction.hysteresis),
    "joint_backlash": (friction.describe_backlash, friction.backlash),
    "joint_nonlinear_stiffness": (elastic.describe_curve, elastic.curve),
    "joint_creep": (elastic.describe_creep, elastic.creep),
    "joint_stiffness_error": (elastic.describe_springs, elastic.springs),
    "link_flexibility": (elastic.describe_links, elastic.links),
    "base_compliance": (elastic.describe_base, elastic.base),
    "contact_seating": (elastic.describe_seating, elastic.seating),
    "load_misalignment": (elastic.describe_misalignment, elastic.misalignment),
    "pose_error": (elastic.describe_pose, elastic.pose),
    "force_scale": (instruments.describe_gain, instruments.force_gain),
    "displacement_scale": (instruments.describe_gain, instruments.displacement_gain),
    "time_lag": (instruments.describe_lag, instruments.lag),
    "force_drift": (instruments.describe_force_drift, instruments.drift_of_force),
    "thermal_drift": (instruments.describe_thermal, instruments.drift_of_displacement),
    "zero_shift": (instruments.describe_shift, instruments.shift),
}
# Coefficients of one session that say nothing of the next: chance, or a path without a law.
SESSION = frozenset({"place", "rest", "shift", "drift_knot", "drift_per_kelvin"})
# Words of one session: their law holds for its course (what to do next is planned with it), and
# another day the amplifier drifts otherwise, the room warms otherwise, the laser is zeroed anew.
OF_SESSION = DRIFTS | {"zero_shift"}


# What these do goes through the joints' springs: the law says which springs it counts from, so
# that it stays the same beside other ones.
_THROUGH_SPRINGS = frozenset({"load_misalignment", "pose_error", "force_scale", "force_drift"})


@dataclass(frozen=True, eq=False)
class Form:
    """An effect with numbers: values (k,) of the law's terms in SI units, covariance (k, k)."""

    word: str
    law: Law
    values: Array
    covariance: Array


def law_of(bench: Bench, variant: Variant) -> tuple[Law, Array]:
    """The law of a variant of the library on its bench, and (k,) its units in those of the law.

    Raises ValueError for a variant that says too little of itself.
    """
    try:
        law, scale = _TABLE[variant.word][0](bench, variant)
    except KeyError as missing:
        raise ValueError(
            f"{variant.word}, {variant.label}: the library does not say {missing} of this shape"
        ) from missing
    if variant.word in _THROUGH_SPRINGS:
        about = tuple(float(c) for c in variant.info.get("compliance", bench.compliance))
        law = replace(law, constants={**law.constants, "about": about})
    return law, scale


def about_springs(bench: Bench, variant: Variant, compliance: Array) -> Variant:
    """The variant of a word whose effect goes through the springs, with these springs (m,) instead
    of the simulated ones; its columns are put into the pool."""
    law, scale = law_of(bench, variant)
    law = replace(law, constants={**law.constants, "about": tuple(compliance.tolist())})
    columns = (rows_of(bench, variant.word, law) * scale).T
    return replace(
        variant, label=f"{variant.label}, {AS_THEY_ARE}", columns=tuple(map(bench.add, columns)),
        info={**variant.info, "compliance": compliance},
    )  # fmt: skip


AS_THEY_ARE = "springs as they are"


def describe(bench: Bench, part: Part, w: Array, covariance: Array) -> Form:
    """The form of a fitted part; w (k,), covariance (k, k): of the variant's coefficients."""
    law, scale = law_of(bench, part.variant)
    return Form(part.word, law, w * scale, covariance * np.outer(scale, scale))


def rows_of(bench: Bench, word: str, law: Law) -> Array:
    """(size, k): stacked columns of the law's terms on this bench, per SI unit."""
    about = law.constants.get("about")
    if about is not None:
        bench = _counted_from(bench, np.array(about))
    columns = _TABLE[word][1](bench, law)
    return np.column_stack(columns) if columns else np.zeros((bench.layout.size, 0))


def _counted_from(bench: Bench, compliance: Array) -> Bench:
    """The bench with these springs (m,)."""
    return replace(
        bench, compliance=compliance, elastic=bench.torque * compliance,
        slope=bench.slope_of(compliance),
    )  # fmt: skip


def realise(bench: Bench, form: Form) -> Array:
    """(size,): what the effect adds to every channel of this bench."""
    return np.asarray(rows_of(bench, form.word, form.law) @ form.values)


def lawful(form: Form) -> Form:
    """The form without the coefficients that say nothing of another procedure."""
    return _of_terms(form, [t.coefficient not in SESSION for t in form.law.terms])


def lasting(form: Form) -> Form:
    """The form with what the arm and the instruments still do in another session; of a drift, of
    jumps of the datum and of what single runs have to themselves nothing is left."""
    stays = form.word not in OF_SESSION
    keep = [stays and t.coefficient not in SESSION and "run" not in t.shape
            for t in form.law.terms]  # fmt: skip
    return _of_terms(form, keep)


def _of_terms(form: Form, keep: list[bool]) -> Form:
    mine = np.flatnonzero(keep)
    law = Law(form.law.constants, tuple(form.law.terms[i] for i in mine))
    return replace(
        form, law=law, values=form.values[mine], covariance=form.covariance[np.ix_(mine, mine)]
    )
