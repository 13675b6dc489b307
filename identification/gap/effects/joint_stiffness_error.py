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

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "joint_stiffness_error"
SCALES = (1.0, 3.0)
BENCH_SCALES = (3.0, 9.0)
PAIRS = 2.0  # prior weight of any two joints, against one certain joint alone
STIFFEST = -0.9  # relative change of what the spring gives (compliance; force, if that answers)


def variants(bench: Bench) -> list[Variant]:
    """Each joint alone, any two, all of them, and all but one, which may have its own trouble."""
    relative = bench.data.compliance_relative_sd
    out, columns = [], []
    for j in bench.moving_joints():
        column = bench.add_joint(j, bench.elastic[:, j])
        columns.append(column)
        beyond = max(2 * float(relative[j]), 0.2)
        scales = tuple(beyond * f for f in SCALES) + (() if bench.data.arm else BENCH_SCALES)
        # a spring's compliance stays positive: a tenth of what is simulated at least
        least, sign = (0.0, False) if bench.data.arm else (STIFFEST, True)
        out.append(
            variant(WORD, f"joint {j + 1}", [column], scales, positive=sign, least=least, joint=j,
                    joints=[j])
        )  # fmt: skip
    if len(columns) > 1:
        scales = tuple(max(2 * float(relative.max()), 0.2) * f for f in SCALES)
        out.append(
            variant(WORD, "all joints", columns, scales, positive=False,
                    joints=bench.moving_joints())
        )  # fmt: skip
    for a, b in combinations(range(len(columns)), 2) if len(columns) > 2 else ():
        pair = [bench.moving_joints()[i] for i in (a, b)]
        out.append(
            variant(WORD, f"joints {pair[0] + 1} and {pair[1] + 1}", [columns[a], columns[b]],
                    scales, positive=False, prior=PAIRS / comb(len(columns), 2), joints=pair)
        )  # fmt: skip
    for k, j in enumerate(bench.moving_joints() if len(columns) > 2 else ()):
        rest = [i for i in bench.moving_joints() if i != j]
        out.append(
            variant(WORD, f"all joints but {j + 1}", columns[:k] + columns[k + 1 :], scales,
                    positive=False, prior=0.5 / len(columns), joints=rest)
        )  # fmt: skip
    return out
