"""The structure is right, its numbers are not: springs beyond what META allows them.

Same columns as the six springs of the base, with a wide prior: a joint may be half or twice as
stiff; a bench's spring may be off by ten.

Size: 0.5 to 2 times as stiff; a bench's spring 0.1 to 10 times.
Prior: relative compliances of either sign, sd SCALES times twice what META states (at least 0.2);
of a bench's spring BENCH_SCALES besides, equally likely.
Source: scatter between gears of one size, and simulators set up from catalogues.
"""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np

from identification.arrays import Array
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import LEAST_FACTOR, Coefficients, Parameter, factors
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant
from identification.uncertainty import TWO_SIDED

WORD = "joint_stiffness_error"
SCALES = (1.0, 3.0)
ARMLESS_SCALES = (3.0, 9.0)
PAIRS = 2.0  # prior weight of any two joints, against one certain joint alone
STIFFEST = -0.9  # relative change of what the spring gives (compliance; force, if that answers)


def variants(bench: Bench) -> list[Variant]:
    """Each joint alone, any two, all of them, and all but one, which may have its own trouble."""
    columns = {j: bench.add_joint(j, bench.elastic[:, j]) for j in bench.moving_joints()}
    out = [_of_one(bench, j, column) for j, column in columns.items()]
    if len(columns) > 1:
        out.append(_of_several(bench, "all joints", columns))
    if len(columns) > 2:
        out += [
            _of_several(
                bench,
                f"joints {a + 1} and {b + 1}",
                {a: columns[a], b: columns[b]},
                prior=PAIRS / comb(len(columns), 2),
            )
            for a, b in combinations(columns, 2)
        ]
        out += [
            _of_several(
                bench,
                f"all joints but {j + 1}",
                {other: columns[other] for other in columns if other != j},
                prior=0.5 / len(columns),
            )
            for j in columns
        ]
    return out


def _of_one(bench: Bench, j: int, column: int) -> Variant:
    beyond = _beyond(float(bench.data.compliance_relative_sd[j]))
    scales = tuple(beyond * f for f in SCALES) + (() if bench.data.arm else ARMLESS_SCALES)
    # a spring's compliance stays positive: a tenth of what is simulated at least
    least, sign = (0.0, False) if bench.data.arm else (STIFFEST, True)
    return variant(
        WORD,
        f"joint {j + 1}",
        [column],
        scales,
        positive=sign,
        least=least,
        joint=j,
        joints=[j],
    )


def _of_several(bench: Bench, label: str, columns: dict[int, int], prior: float = 1.0) -> Variant:
    """columns: by joint."""
    beyond = _beyond(float(bench.data.compliance_relative_sd.max()))
    scales = tuple(beyond * f for f in SCALES)
    return variant(
        WORD,
        label,
        list(columns.values()),
        scales,
        positive=False,
        prior=prior,
        joints=list(columns),
    )


def _beyond(stated: float) -> float:
    """Relative size of what is no longer within a stated relative sd."""
    return max(2 * stated, 0.2)


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Factor on the stiffness: of compliance where force is imposed, else of force. The spring it
    acts on is known to its stated relative sd only, by which the factor can be told no better."""
    out = {}
    for i, j in enumerate(v.info["joints"]):
        change, variance = float(found.w[i]), float(found.cov[i, i])
        stated = 0.0
        if j in found.softer.value:  # what the spring itself was given belongs to the whole
            change += found.softer.value[j]
            variance += found.softer.variance[j] + 2 * float(found.softer.cross[j][i])
            stated = float(bench.data.compliance_relative_sd[j])
        whole = max(1 + change, LEAST_FACTOR)
        nats = TWO_SIDED * float(np.hypot(max(variance, 0.0) ** 0.5 / whole, stated))
        spread = np.exp(min(nats, -np.log(LEAST_FACTOR)))
        value = whole if bench.imposed else 1 / whole
        name = bench.data.spring_name(j)
        out[f"factor_{name}"] = factors(value, float(spread), "1")
    return out


def _describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: joints whose compliance is another."""
    joints = [int(j) for j in v.info["joints"]]
    terms = tuple(Term("compliance", {"joint": j}) for j in joints)
    return Law({}, terms), np.asarray(bench.compliance[joints])


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Deflection of the joint per unit of compliance: its torque."""
    joints = [t.shape["joint"] for t in law.terms]
    return [bench.joint_column(j, bench.torque[:, j]) for j in joints]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns),
    lengths=(),
    finer=None,
)
