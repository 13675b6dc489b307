"""What a fitted explanation leaves behind and what repeats of it: how large, and where.

The residual of a fit is read as `r = g(setup, branch, force) + noise`, with g a Gaussian process
over levels of load: alike for neighbouring loads of one setup, half so between branches (as
`evidence.alike` has it), of unknown size eta; or g is at one level alone, as where a law cuts a
corner. Noise is that of the instruments, and what visits of a level scatter beyond that. Everything
is Gaussian for a given eta, so the posterior of g is exact (Rasmussen and Williams, Gaussian
Processes for Machine Learning, 2006, eq. 2.23-2.24), and eta is integrated over a grid. No claim
about a cause: this is the size of what no effect explains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import LOADING, UNLOADING
from identification.gap.evidence.alike import alike
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.fit import Fit
from identification.gap.model.bench import Bench
from identification.gap.recording.rows import classes, ids

_TURN = 0.02
_CLASSES = 24  # of the load of a running recording, per sense of motion
_SIZES = 40  # grid points of eta
_SMALLEST = 0.05  # of the noise of a level: an eta below that can't be told from none
_DRAWS = 2000
CLEAR = 2.0  # standard deviations from zero at which a level's remainder counts as seen


@dataclass(frozen=True, eq=False)
class Place:
    """One level: where it is (mean force N and displacement m as measured), and its remainder with
    its standard deviation, m."""

    pose: str
    direction: str
    branch: int
    force: float
    displacement: float
    mean: float
    sd: float


@dataclass(frozen=True, eq=False)
class Remainder:
    """Repeatable structure that an explanation leaves, k levels, lengths in m.

    setup, branch (k,): of each level; branch as in `data` (of a running recording: loading where
    the load rises, unloading where it falls). load (k,) N; displacement (k,) as measured;
    samples (k,). residual (k,): mean left
    by the fit; noise (k,): its standard deviation by noise alone. mean, sd (k,): posterior of the
    repeatable part. rms with ci95: over samples, of that part. largest: the level where it stands
    out most clearly, None where none is clear. visits: how often a level was visited on average;
    with one visit, what repeats and what does not are the same to these data. unrepeated_rms: by
    how much visits of a level differ beyond their noise (a drift or a memory nobody modelled).
    """

    setup: Ints
    branch: Ints
    load: Array
    displacement: Array
    samples: Array
    residual: Array
    noise: Array
    mean: Array
    sd: Array
    rms: float
    ci95: tuple[float, float]
    largest: Place | None
    visits: float
    unrepeated_rms: float

    @property
    def clear(self) -> bool:
        """Some level's remainder is told from zero, and its size from the noise's."""
        return self.largest is not None


def remainder(engine: Engine, fit: Fit) -> Remainder:
    """The flexible remainder of a fit; deterministic."""
    bench, n = engine.bench, engine.bench.rows.n
    left = engine.target[:n] - fit.response
    branch = branches(bench)
    level = _level_ids(bench, branch)
    residual, variance, visits, unrepeated = _levels(bench, level, left, engine.sigma[:n])
    samples = np.bincount(level, weights=bench.rows.weight).astype(float)

    def mean_of(values: Array) -> Array:
        return np.asarray(np.bincount(level, weights=values * bench.rows.weight) / samples)

    load, first = mean_of(bench.load), np.unique(level, return_index=True)[1]
    setup, branch = bench.rows.setup[first], branch[first]
    covariance = alike(setup, branch, load, float(np.ptp(bench.load)))
    mean, sd, draws = _posterior(covariance, residual, variance, alone=visits > 1)
    weight = samples / samples.sum()
    low, high = np.quantile(np.sqrt(draws**2 @ weight), [0.025, 0.975])
    out = Remainder(
        setup=setup,
        branch=branch,
        load=load,
        displacement=mean_of(bench.rows.displacement),
        samples=samples,
        residual=residual,
        noise=np.sqrt(variance),
        mean=mean,
        sd=sd,
        rms=float(np.sqrt(mean**2 @ weight)),
        ci95=(float(low), float(high)),
        largest=None,
        visits=visits,
        unrepeated_rms=unrepeated,
    )
    return replace(out, largest=_largest_level(bench, out, mean_of(bench.rows.measured_force)))


def branches(bench: Bench) -> Ints:
    """(n,) branch of every row; of a running recording, which way the load runs: what comes back
    by less than a fiftieth of the range is no turn."""
    if not bench.rows.continuous:
        return bench.rows.branch
    back = _TURN * float(np.ptp(bench.load))
    out, top, bottom, sense = [], -np.inf, np.inf, LOADING
    for x in bench.load.tolist():
        top, bottom = max(top, x), min(bottom, x)
        if sense == LOADING and x < top - back:
            sense, bottom = UNLOADING, x
        elif sense == UNLOADING and x > bottom + back:
            sense, top = LOADING, x
        out.append(sense)
    return np.array(out, dtype=np.int64)


def _level_ids(bench: Bench, branch: Ints) -> Ints:
    """(n,) number of the level of every row. Of a running recording: classes of what drives it,
    since on a plateau what answers stands still."""
    rows = bench.rows
    if not rows.continuous:
        return rows.level
    return ids(np.column_stack([rows.setup, branch, classes(bench.load, _CLASSES)]))


def _levels(
    bench: Bench, level_of: Ints, left: Array, sigma: Array
) -> tuple[Array, Array, float, float]:
    """Mean residual of every level, its variance, visits per level, and rms of what differs between
    visits beyond their noise.

    A visit is what one hold (one stretch of a running recording) spends at a level: its rows share
    what is common to a hold. What visits of a level differ by beyond their noise is alike at all
    levels, and adds to the variance of each visit (`_excess`).
    """
    rows = bench.rows
    pairs = np.column_stack([level_of, rows.hold])
    kinds, visit = np.unique(pairs, axis=0, return_inverse=True)
    visit = visit.reshape(-1)
    precision = np.bincount(visit, weights=1 / sigma**2)
    value = np.bincount(visit, weights=left / sigma**2) / precision
    common = np.zeros(len(kinds))
    common[visit] = bench.noise.hold
    alone = 1 / precision + common**2
    level = kinds[:, 0]
    p = 1 / (alone + _excess(value, alone, level))
    total = np.bincount(level, weights=p)
    mean = np.bincount(level, weights=p * value) / total
    free = len(value) - len(total)
    samples = np.bincount(visit, weights=rows.weight)
    # the mean of the visits is one of them: it takes its share of their noise
    share = p / total[level]
    own = (1 - 2 * share) * alone + np.bincount(level, weights=share**2 * alone)[level]
    beyond = (value - mean[level]) ** 2 - own
    excess_square = float(samples @ beyond) / float(samples.sum()) if free > 0 else 0.0
    unrepeated = float(np.sqrt(max(excess_square, 0.0)))
    return mean, 1 / total, len(value) / len(total), unrepeated


def _excess(value: Array, variance: Array, level: Ints) -> float:
    """Variance (m^2) to be added to that of all visits (v,), so that they differ within their
    levels as much as it says: chi squared is its degrees of freedom (Paule and Mandel 1982)."""
    free = len(value) - int(level.max()) - 1

    def chi_squared(added: float) -> float:
        p = 1 / (variance + added)
        mean = np.bincount(level, weights=p * value) / np.bincount(level, weights=p)
        return float(p @ (value - mean[level]) ** 2)

    if free < 1 or chi_squared(0.0) <= free:
        return 0.0
    low, high = 0.0, float(np.var(value)) * len(value) / free  # chi squared is less there
    for _ in range(_HALVINGS):  # a root of scipy.optimize costs a tenth of a second of import
        middle = (low + high) / 2
        low, high = (middle, high) if chi_squared(middle) > free else (low, middle)
    return high


_HALVINGS = 40


def _posterior(
    covariance: Array, y: Array, variance: Array, *, alone: bool = False
) -> tuple[Array, Array, Array]:
    """Mean (k,), sd (k,) and draws (d, k) of g, eta integrated over a grid even in its logarithm.

    covariance (k, k): of unit size; y (k,): g plus noise of that variance (k,). alone: g may be at
    one level alone, too, which is as likely as all of it.
    """
    floor = _SMALLEST * float(np.sqrt(np.median(variance)))
    top = max(3 * float(np.abs(y).max()), 10 * floor)
    etas = np.geomspace(floor, top, _SIZES)
    logs, means, roots = [_log_of_none(y, variance)], [np.zeros(len(y))], [np.zeros((len(y), 1))]
    for eta in etas:
        prior = eta**2 * covariance
        factor = np.linalg.cholesky(prior + np.diag(variance))
        white = np.linalg.solve(factor, y)
        gain = np.linalg.solve(factor, prior)
        logs.append(-0.5 * float(white @ white) - float(np.log(np.diag(factor)).sum()))
        means.append(gain.T @ white)
        roots.append(_root(prior - gain.T @ gain))
    # none is as likely as the whole grid of sizes
    each = [1.0] + [1 / _SIZES] * _SIZES
    # what does not stand out of its noise does not do so alone
    for k in np.flatnonzero(alone & (np.abs(y) > CLEAR * np.sqrt(variance))):
        for eta in etas:
            both = variance[k] + eta**2
            gained = 0.5 * (y[k] ** 2 / variance[k] - y[k] ** 2 / both - np.log(both / variance[k]))
            here = np.eye(len(y))[:, [k]]
            logs.append(logs[0] + float(gained))
            means.append(here[:, 0] * y[k] * eta**2 / both)
            roots.append(here * eta * np.sqrt(variance[k] / both))
            each.append(1 / _SIZES / len(y))
    p = np.array(each) * np.exp(np.array(logs) - max(logs))
    p /= p.sum()
    draws = _mixture(p, means, roots)
    mean = np.einsum("e,ek->k", p, np.array(means))
    square = sum(w * (m**2 + np.sum(r**2, axis=1)) for w, m, r in zip(p, means, roots, strict=True))
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0)), draws


def _log_of_none(y: Array, variance: Array) -> float:
    """Log density of y (k,) by noise alone, but for a constant."""
    return -0.5 * float(np.sum(y**2 / variance + np.log(variance)))


def _root(covariance: Array) -> Array:
    """A square root of a covariance that may be singular, (k, k)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _mixture(p: Array, means: list[Array], roots: list[Array]) -> Array:
    """Draws (d, k) from the posterior: each size in proportion to its probability."""
    rng = np.random.default_rng(0)
    out = []
    for count, mean, root in zip(rng.multinomial(_DRAWS, p), means, roots, strict=True):
        out.append(mean + rng.standard_normal((count, root.shape[1])) @ root.T)
    return np.concatenate(out)


def _largest_level(bench: Bench, m: Remainder, force: Array) -> Place | None:
    """The largest remainder among the levels where it is clear."""
    clear = np.abs(m.mean) > CLEAR * m.sd
    if not clear.any() or not np.any(m.mean):
        return None
    k = int(np.argmax(np.where(clear, np.abs(m.mean), 0.0)))
    where = bench.data.setups[m.setup[k]]
    return Place(
        where.pose,
        where.direction,
        int(m.branch[k]),
        float(force[k]),
        float(m.displacement[k]),
        float(m.mean[k]),
        float(m.sd[k]),
    )
