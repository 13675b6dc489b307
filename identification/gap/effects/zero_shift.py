"""The laser's datum jumps between repetitions: whole runs offset; encoders do not see it.

Size: 2 to 200 um; 0.3 to 30 % of the deflection.
Prior: either sign, sd out of SHARES, equally likely; half of it on shifts of every run.
Source: knocked targets, re-clamped sensors, a zero key pressed between runs.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "zero_shift"
SHARES = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the deflection


def variants(bench: Bench) -> list[Variant]:
    """One lasting jump before any run but the first of its setup, and free shifts of all."""
    rows = bench.rows
    if bench.data.datum == "repetition":
        return []
    scales = tuple(s * bench.reach for s in SHARES)
    out, shifts, shifted = [], [], []
    for s in range(len(bench.data.setups)):
        mine = rows.setup == s
        runs = list(dict.fromkeys(rows.run[mine].tolist()))
        for r in runs[1:]:
            shifted.append(r)
            jump = bench.add(bench.outside_column((mine & (rows.run >= r)).astype(float)))
            shifts.append(bench.add(bench.outside_column((rows.run == r).astype(float))))
            out.append(
                variant(WORD, f"jump before run {r + 1}", [jump], scales, positive=False, runs=[r])
            )
    if len(shifts) > 1:
        out.append(
            variant(
                WORD,
                "every run",
                shifts,
                scales,
                positive=False,
                prior=float(len(out)),
                runs=[],
                shifts=shifted,
            )
        )
    return out


def _parameters(_: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    if len(found.w) == 1:
        run = v.info["runs"][0] + 1
        return {f"shift_before_run{run}": found.one(0, "mm", 1e3)}
    return {f"shift{i + 1}": found.one(i, "mm", 1e3) for i in range(len(found.w))}


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: one lasting jump before a run, or the offsets of whole runs (numbers from 0)."""
    if v.info["runs"]:
        terms = tuple(Term("shift", {"run": int(r), "lasts": True}) for r in v.info["runs"])
    else:
        terms = tuple(Term("shift", {"run": int(r), "lasts": False}) for r in v.info["shifts"])
    return Law({}, terms), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """The runs of that setup, from the jump on or that one alone."""
    rows, out = bench.rows, []
    for t in law.terms:
        r = t.shape["run"]
        mine = np.zeros(rows.n)
        if np.any(rows.run == r):
            setup = rows.setup[int(np.argmax(rows.run == r))]
            mine = np.where((rows.setup == setup) & (rows.run >= r), 1.0, 0.0)
            mine = mine if t.shape["lasts"] else np.where(rows.run == r, 1.0, 0.0)
        out.append(bench.outside_column(mine))
    return out


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns, of_session=("shift",), lasts=False),
    lengths=(),
    finer=None,
)
