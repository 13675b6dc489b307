"""Evidence of `rig diagnose` against nested sampling (dynesty) on small cases, and time of both.

    python bench/nested_sampling.py [--live 100] [--cases yield ...] [--json F]

The other route shares with the diagnosis the rows, their noise and the priors. Everything else is
built anew: nuisances and imperfection as one dense covariance matrix (`bench/dense_model.py`); laws
by loops over the rows; coefficients, their scale, the form (threshold, strength) and the size of
the imperfection are sampled.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from bench.dense_model import Dense, dense, nuisances, stacked
from bench.nested_cases import CASES, case_data
from identification.gap.effects import library
from identification.gap.evidence.compare import Scored, log_mean, score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.evidence.finer import gained
from identification.gap.evidence.imperfection import IMPERFECTION, least_size
from identification.gap.evidence.parts import Part, part_sizes
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from identification.gap.search.search import search

Array = NDArray[np.float64]
_SPREAD = np.log(2.5)  # of the imperfection's share, one sd of its logarithm
_IMPOSSIBLE = -1e300
NEAR = (
    30.0  # nats below the best form of a word: what lies further down adds nothing, and is left out
)


# --- models ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Form:
    """One form of an effect: stacked columns (N, k), and the library's variant with its prior."""

    columns: Array
    variant: Variant


def played(load: Array, starts: NDArray[np.bool_], radius: float) -> Array:
    """Play, step by step; between two runs the load goes back to zero."""
    out, state = np.empty_like(load), 0.0
    for i, x in enumerate(load):
        if starts[i]:
            state = min(max(state, -radius), radius)
        state = min(x + radius, max(x - radius, state))
        out[i] = state
    return out


SEATS: dict[str, Callable[[Array], Array]] = {
    "exponential": lambda x: -np.expm1(-x),
    "hyperbolic": lambda x: x / (1 + x),
}


def forms(bench: Bench, word: str, variants: list[Variant]) -> list[Form]:
    """Forms of joint 1 (of the fixture) that the comparison is about, by laws of its own."""
    rows = bench.rows
    lever = np.array([bench.data.setups[s].lever[0] for s in rows.setup])
    c, torque = bench.data.compliance[0], lever * rows.force

    def joint(deflection: Array) -> Array:
        q = np.zeros((rows.n, bench.data.joints))
        q[:, 0] = deflection
        return stacked(bench, lever * deflection, q)

    out = []
    for v in (v for v in variants if v.word == word):
        if word == "joint_yield" and v.label.startswith("joint 1 at") and v.label.endswith("sharp"):
            parts = [joint(c * played(torque, rows.starts, r)) for r in v.info["radius"]]
        elif word == "joint_hysteresis" and (
            v.label == "joint 1 spectrum"
            or (v.label.startswith("joint 1 r ") and v.info["law"] == "Iwan")
        ):
            stops = [torque - played(torque, rows.starts, r) for r in v.info["radius"]]
            parts = [joint(-c * s) for s in stops]
        elif word == "contact_seating" and len(v.columns) == 1 and v.info["laws"][0][0] in SEATS:
            law = SEATS[v.info["laws"][0][0]]
            x = np.abs(rows.force) / v.info["force_N"]
            parts = [stacked(bench, np.sign(rows.force) * law(x))]
        else:
            continue
        out.append(Form(np.column_stack(parts), v))
    return out


MODELS = ("none", "joint_yield", "joint_hysteresis", "contact_seating")


@dataclass
class Prior:
    """Coefficients under the signs that physics wants, from uniform numbers; a weight to add."""

    variant: Variant
    log_share: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        v, draws = (
            self.variant,
            np.random.default_rng(1).normal(size=(200_000, len(self.variant.columns))),
        )
        for s in v.scales:
            w = s * draws @ v.root.T
            kept = np.ones(len(w), dtype=bool) if v.positive is None else w @ v.positive > v.least
            kept &= np.all(w[:, np.array(v.each)] > 0, axis=1) if any(v.each) else True
            self.log_share.append(float(np.log(kept.mean())))

    def coefficients(self, u: Array, scale: int) -> tuple[Array, float]:
        """w (k,) and the log of what the truncation weighs, or an impossible one."""
        v = self.variant
        T = v.scales[scale] * v.root
        if v.positive is None:
            return np.asarray(T @ ndtri(u)), 0.0
        if any(v.each):
            return self._orthant(u, T, scale)
        along = T.T @ v.positive
        length = float(np.linalg.norm(along))
        axis, low = along / length, ndtr(v.least / length)
        z = ndtri(u)
        first = float(ndtri(min(low + u[0] * (1 - low), 1 - 1e-15)))
        rest = _across(axis) @ z[1:] if len(z) > 1 else 0.0
        return np.asarray(T @ (first * axis + rest)), 0.0

    def _orthant(self, u: Array, T: Array, scale: int) -> tuple[Array, float]:
        """One coefficient after the other, each above zero given those before it."""
        L = np.linalg.cholesky(T @ T.T)
        z, log_weight = np.zeros(len(u)), 0.0
        for i in range(len(u)):
            low = float(ndtr(-(L[i, :i] @ z[:i]) / L[i, i]))
            log_weight += float(np.log1p(-min(low, 1 - 1e-15)))
            z[i] = ndtri(min(low + u[i] * (1 - low), 1 - 1e-15))
        w = L @ z
        if self.variant.positive is not None and self.variant.positive @ w <= self.variant.least:
            return w, _IMPOSSIBLE
        return w, log_weight - self.log_share[scale]


def _across(axis: Array) -> Array:
    """Orthonormal basis (k, k - 1) of what is across an axis."""
    return np.asarray(np.linalg.svd(axis[None, :])[2][1:].T)


def sampled_evidence(
    model: Dense, found: list[Form], etas: Array, live: int
) -> tuple[float, float]:
    """log evidence and its error: coefficients and imperfection sampled, form by form and scale by
    scale (a sampler that has to find the form as well misses narrow ones)."""
    values, errors, weights = [], [], []
    for f in found:
        for s in range(len(f.variant.scales)):
            value, error = _sampled_form(model, f, s, etas, live)
            values.append(value)
            errors.append(error)
            weights.append(f.variant.prior / len(f.variant.scales))
    share = np.exp(np.array(values) - max(values)) * np.array(weights)
    share /= share.sum()
    return log_mean(values, weights), float(np.sqrt(np.sum((share * np.array(errors)) ** 2)))


def _sampled_form(
    model: Dense, form: Form, scale: int, etas: Array, live: int
) -> tuple[float, float]:
    bench, rows = model.bench, model.bench.rows
    turned, prior = model.turn.T @ form.columns, Prior(form.variant)
    moved = _less_datum(bench, form.columns[: rows.n])
    share = rows.weight / rows.weight.sum()

    def log_likelihood(u: Array) -> float:
        w, weight = prior.coefficients(u[1:], scale)
        if weight <= _IMPOSSIBLE:
            return _IMPOSSIBLE
        size = float(np.sqrt(share @ (moved @ w) ** 2))
        least = least_size(etas, size**2) - np.log(IMPERFECTION * size)
        low = float(ndtr(least / _SPREAD))
        factor = float(np.exp(_SPREAD * ndtri(low + u[0] * (1 - low))))
        return model.log_density(turned @ w, IMPERFECTION * size * factor) + weight

    return nested(log_likelihood, 1 + len(form.variant.columns), live)


def _less_datum(bench: Bench, u: Array) -> Array:
    rows, out = bench.rows, u.copy()
    for s in np.unique(rows.setup):
        mine = rows.setup == s
        out[mine] -= np.average(u[mine], axis=0, weights=rows.weight[mine])
    return out


def sampled_none(bench: Bench, etas: Array, live: int) -> tuple[float, float]:
    """Springs and gains sampled too; imperfection none, or the smallest."""
    model = dense(bench, drop=("spring", "gain"))
    free = [(c, sd) for name, c, sd in nuisances(bench) if name.startswith(("spring", "gain"))]
    free = [(c, sd) for c, sd in free if np.any(c)]
    turned = model.turn.T @ np.column_stack([c * sd for c, sd in free])

    def log_likelihood(u: Array) -> float:
        eta = 0.0 if u[0] < 0.95 else float(etas[1])
        return model.log_density(turned @ ndtri(u[1:]), eta)

    return nested(log_likelihood, 1 + len(free), live)


def nested(log_likelihood: Callable[[Array], float], ndim: int, live: int) -> tuple[float, float]:
    """dynesty on the unit cube."""
    from dynesty import NestedSampler  # type: ignore[import-untyped]

    def inside(u: Array) -> Array:
        return np.clip(u, 1e-12, 1 - 1e-12)

    sampler = NestedSampler(
        log_likelihood,
        inside,
        ndim,
        nlive=live,
        bound="multi",
        sample="rwalk",
        rstate=np.random.default_rng(0),
    )
    sampler.run_nested(dlogz=0.1, print_progress=False)
    return float(sampler.results.logz[-1]), float(sampler.results.logzerr[-1])


# --- both routes -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """One model on one case: log evidence by both routes (nats) and seconds of the sampled one."""

    case: str
    model: str
    ours: float
    sampled: float
    error: float
    seconds: float


def compare(
    name: str, live: int, models: tuple[str, ...] = MODELS, signs: bool = True, fine: bool = False
) -> tuple[list[Line], float]:
    """Lines of a case, and the seconds our route takes to all probabilities. signs: coefficients
    keep the signs that physics wants; else both routes let them take either. fine: sizes of the
    imperfection in steps of a quarter, as our route does not take them."""
    start = time.perf_counter()
    bench = make_bench(case_data(name))
    base = base_columns(bench)
    target = bench.observed - prediction(bench)
    variants = library(bench)
    etas = eta_levels(bench, base, target)
    if fine:
        steps = 1 + round(np.log(etas[-1] / etas[1]) / np.log(1.25))
        etas = np.concatenate([[0.0], np.geomspace(etas[1], etas[-1], steps)])
    engine = Engine(bench, base, target, etas)
    search(engine, variants)
    ours_s = time.perf_counter() - start
    offset = -float(np.sum(np.log(engine.sigma))) - 0.5 * bench.layout.size * np.log(2 * np.pi)
    model, out = dense(bench), []
    for word in models:
        start = time.perf_counter()
        if word == "none":
            two = [engine.levels[0].log_base, engine.levels[1].log_base]
            ours = log_mean(two, [0.95, 0.05])
            value, error = sampled_none(bench, etas, live)
        else:
            found = forms(bench, word, variants)
            if not signs:
                found = [replace(f, variant=_free(f.variant)) for f in found]
            scored = score(engine, engine.levels, [f.variant for f in found])
            best = max(s.log_evidence for s in scored)
            near = [s.log_evidence > best - NEAR for s in scored]
            found = [f for f, yes in zip(found, near, strict=True) if yes]
            scored = [s for s, yes in zip(scored, near, strict=True) if yes]
            each = [s.log_evidence - float(np.log(s.variant.prior)) for s in scored]
            ours = log_mean(each, [s.variant.prior for s in scored])
            ours += gained(engine, *_best_part(engine, scored))
            value, error = sampled_evidence(model, found, etas, live)
        seconds = time.perf_counter() - start
        out.append(Line(name, word, ours + offset, value, error, seconds))
    return out, ours_s


def _best_part(engine: Engine, scored: list[Scored]) -> tuple[tuple[Part], float]:
    """The likeliest form, with its mean square (m^2)."""
    best = max(scored, key=lambda s: s.log_evidence)
    parts = (Part(best.variant, best.scale),)
    return parts, part_sizes(engine, parts, best.level).energy


def _free(v: Variant) -> Variant:
    return replace(v, positive=None, each=(False,) * len(v.columns), within=v.within[:0], least=0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--live", type=int, default=100)
    parser.add_argument("--cases", nargs="*", default=list(CASES))
    parser.add_argument("--free-signs", action="store_true", help="coefficients of either sign")
    parser.add_argument("--fine", action="store_true", help="fine steps of imperfection")
    parser.add_argument("--models", nargs="*", default=list(MODELS))
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    lines: list[Line] = []
    ratios = []
    for name in args.cases:
        of_case, ours_s = compare(
            name, args.live, tuple(args.models), not args.free_signs, args.fine
        )
        lines += of_case
        for x in of_case:
            print(
                f"{x.case:20s} {x.model:18s} ours {x.ours:9.2f}  sampled {x.sampled:9.2f} +- "
                f"{x.error:.2f}  difference {x.ours - x.sampled:+.2f}  {x.seconds:.1f} s",
                flush=True,
            )
        words = [x.seconds for x in of_case if x.model != "none"]
        sampled_s = float(np.mean(words)) * 18  # one effect at a time, joint 1 and few forms only
        ratios.append(sampled_s / ours_s)
        print(
            f"{name:20s} all probabilities: ours {ours_s:.2f} s; 18 words sampled one by one, "
            f"few forms each, no pairs: {sampled_s:.0f} s; ratio {ratios[-1]:.0f}",
            flush=True,
        )
    worst = max(lines, key=lambda x: abs(x.ours - x.sampled))
    print(
        f"largest difference {worst.ours - worst.sampled:+.2f} nats ({worst.model} on "
        f"{worst.case}); slowest ratio {min(ratios):.0f}"
    )
    if args.json:
        args.json.write_text(json.dumps([vars(x) for x in lines], indent=1))


if __name__ == "__main__":
    main()
