"""The same mechanism at another place: what no channel of these data could tell from a fitted one.

A joint that yields and a mounting that slips follow one law on different levers. Where the levers
run in proportion over all setups (one pose; or joint 1 and the base's vertical axis, always) and no
joint readings are there, the evidence of the two differs by priors and grids alone; here the law is
moved as it is, its thresholds in proportion to the levers, and compared channel by channel.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.answer.forms import Form, law_of, rows_of
from identification.gap.effects.base_slip import lever_of, places
from identification.gap.evidence.engine import LEVER_M, Engine
from identification.gap.evidence.parts import Part
from identification.gap.laws.law import AS_IT_STANDS, Law, Term
from identification.gap.model.bench import Bench

_SAME = 1.0  # nats of misfit that another place may cost: nobody would call that evidence


@dataclass(frozen=True)
class EquivalentPlace:
    """Where else a law could sit for all that the data show. word: of the effect there; constants:
    of the law there (joint, or axis and depth); factor: torque there over torque here."""

    word: str
    constants: Mapping[str, Any]
    factor: float

    def moved(self, law: Law) -> Law:
        """The law at the other place."""
        kept = {k: v for k, v in law.constants.items() if k not in (*PLACE, AS_IT_STANDS)}
        terms = tuple(
            Term(t.coefficient, {k: v * self.factor for k, v in t.shape.items()}) for t in law.terms
        )
        return Law({**kept, **self.constants}, terms)

    def form(self, form: Form) -> Form:
        """The same motion of the target from the other place: less compliance on a longer lever."""
        share = self.factor**-2
        return Form(
            self.word, self.moved(form.law), share * form.values, share**2 * form.covariance
        )


PLACE = ("joint", "axis", "depth")


def equivalent_place(engine: Engine, part: Part, w: Array, eta: float) -> EquivalentPlace | None:
    """Where else the part with coefficients w (k,) could sit for all that the data show;
    imperfection eta m."""
    bench = engine.bench
    if part.word not in ("joint_yield", "base_slip") or not bench.data.arm:
        return None
    law, _ = law_of(bench, part.variant)
    own = engine.columns(part.variant.columns) @ w
    here = float(np.abs(_lever(bench, law)).max())
    other = "base_slip" if part.word == "joint_yield" else "joint_yield"
    for constants, lever in _places(bench, other):
        there = float(np.abs(lever).max())
        if there < 0.02 or not here > 0:
            continue
        twin = EquivalentPlace(other, constants, there / here)
        if _misfit(engine, own, rows_of(bench, other, twin.moved(law)), eta) < _SAME:
            return twin
    return None


def _lever(bench: Bench, law: Law) -> Array:
    """(n,): torque or moment that loads the mechanism, per newton."""
    c = law.constants
    if "joint" in c:
        return np.asarray(bench.lever[:, c["joint"]])
    return lever_of(bench, c["axis"], c["depth"])


def _places(bench: Bench, word: str) -> Iterator[tuple[dict[str, Any], Array]]:
    if word == "joint_yield":
        for j in bench.moving_joints():
            yield {"joint": j}, bench.lever[:, j]
        return
    for axis, depth in sorted(places(), key=lambda p: p[0] != "z"):
        yield {"axis": axis, "depth": depth}, lever_of(bench, axis, depth)


def _misfit(engine: Engine, own: Array, columns: Array, eta: float) -> float:
    """nats by which the columns, with springs and instruments adapting, miss the contribution."""
    bench, n = engine.bench, engine.bench.rows.n
    variance = engine.sigma**2
    variance[:n] += bench.noise.hold**2 + eta**2
    variance[bench.layout.q] += (eta / LEVER_M) ** 2 + bench.noise.q_run**2
    root = 1 / np.sqrt(variance)
    size = np.linalg.norm(columns * root[:, None], axis=0)
    free = (columns * root[:, None])[:, size > 0] / size[size > 0]
    base = engine.base.columns * (engine.base.sd * root[:, None])
    # the base adapts under its prior, the columns freely: left of both is what the base leaves
    whole = np.column_stack([free, own * root])
    inner = np.eye(base.shape[1]) + base.T @ base
    shared = base.T @ whole
    gram = whole.T @ whole - shared.T @ np.linalg.solve(inner, shared)
    k = free.shape[1]
    return 0.5 * float(gram[k, k] - gram[k, :k] @ np.linalg.pinv(gram[:k, :k], 1e-10) @ gram[:k, k])
