"""The springs that an effect goes through, found together with it.

What pulls across the load, a drift of the force or a lag moves the target by `(1 + s) w`, with s
the change of a spring and w the coefficient: a product. Going to and fro between the two need not
end anywhere (a joint that the load itself hardly turns has its spring from what pulls across alone)
and may end with a spring that is off the wrong way. Here both are solved for at once, by Gauss and
Newton: about s and w the product is `w + s dw + w ds`, to second order in what is still missing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.evidence.compare import closest, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.fit import weighed
from identification.gap.laws.law import Laws
from identification.gap.model.variants import Variant, block
from identification.gap.words import SPRINGS

_FAR = 0.1, 10.0  # of the simulated compliance: no spring is softer or stiffer by more
_STEPS = 12  # at most: four are enough where they end anywhere
_DONE = 1e-3  # of a spring
_LEVELS = 2  # of imperfection, at most, that springs are found with


def about_springs(laws: Laws, engine: Engine, found: Variant) -> Variant:
    """A variant of what goes through the springs, linearised about the likeliest springs, which are
    found together with it alone."""
    out, done = found, list[float]()
    for _ in range(_LEVELS):
        best = closest(score(engine, engine.levels, [out]))
        eta = float(engine.levels[best.level].eta)
        if eta in done:
            break
        done.append(eta)
        compliance = springs_found(laws, engine, Part(out, best.scale), (), eta)
        out = laws.about_springs(engine.bench, found, compliance)
    return out


def springs_found(
    laws: Laws, engine: Engine, part: Part, beside: tuple[Part, ...], eta: float
) -> Array:
    """(m,) rad/Nm (of a rig without an arm m/N): compliance of the springs that are likeliest
    together with a part that goes through them, with an imperfection of eta m, beside other
    parts."""
    bench, base = engine.bench, engine.base
    joints, places = _springs(engine, beside)
    each, rest = _through_each(laws, engine, part.variant, joints)
    if not np.any(each):  # a laser's lag, or an imposed displacement
        about = part.variant.about
        return bench.compliance if about is None else about
    others = engine.columns(c for p in beside for c in p.variant.columns)
    root = block([np.diag(base.sd), *(p.root for p in beside), part.root])
    softer: Array = np.zeros(len(joints))
    w = np.zeros(len(part.variant.columns))
    for _ in range(_STEPS):
        through = each @ w  # (springs, size) what each of them, as simulated, does to the part
        columns = np.hstack([base.columns, others])
        columns[:, places[1]] += through[places[0]].T
        now = rest + np.tensordot(1 + softer, each, axes=1)
        X = np.hstack([columns, now]) @ root
        precise = weighed(engine, X, eta)
        target = engine.target + softer @ through
        x = root @ np.linalg.solve(precise.T @ X + np.eye(len(root)), precise.T @ target)
        change = np.bincount(places[0], weights=x[places[1]], minlength=len(joints))
        last, softer = softer, np.asarray(np.clip(1 + change, *_FAR) - 1, dtype=float)
        w = x[len(x) - len(w) :]
        if np.abs(softer - last).max(initial=0.0) < _DONE:
            break
    out = bench.compliance.copy()
    out[joints] *= 1 + softer
    return out


def _springs(engine: Engine, beside: tuple[Part, ...]) -> tuple[list[int], Ints]:
    """Joints whose springs may be others; and of every coefficient that says so, of the base and of
    parts, which of these it is of and which column it has (2, c)."""
    found = list(engine.base.springs.items())
    first = engine.base.columns.shape[1]
    for p in beside:
        if p.word == SPRINGS:
            found += [(j, first + k) for k, j in enumerate(p.variant.joints)]
        first += len(p.variant.columns)
    joints = sorted({j for j, _ in found})
    places = [(joints.index(j), column) for j, column in found]
    return joints, np.array(places, dtype=int).reshape(-1, 2).T


def _through_each(
    laws: Laws, engine: Engine, variant: Variant, joints: list[int]
) -> tuple[Array, Array]:
    """What a variant does through the spring of each of these joints, as simulated (springs, size,
    k), and through nothing of these (size, k): columns are linear in the compliance of each."""
    bench = engine.bench
    law, scale = laws.of(bench, variant)

    def through(compliance: Array) -> Array:
        about = {**law.constants, "about": tuple(compliance.tolist())}
        return laws.rows(bench, replace(law, constants=about)) * scale

    kept = bench.compliance.copy()
    kept[joints] = 0.0
    rest = through(kept)
    alone = [np.where(np.arange(len(kept)) == j, bench.compliance, kept) for j in joints]
    each = np.array([through(c) - rest for c in alone])
    return each.reshape(len(joints), *rest.shape), rest
