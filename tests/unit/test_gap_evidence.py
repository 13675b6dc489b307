"""Evidence against the dense Gaussian it stands for, and the search's building blocks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from identification.gap.effects import library
from identification.gap.evidence import table
from identification.gap.evidence.compare import condition, log_mean, score
from identification.gap.evidence.engine import (
    HOLD_PART,
    ROW_PART,
    RUN_PART,
    Engine,
    hold_part,
    level_columns,
    level_covariance,
    run_columns,
)
from identification.gap.evidence.imperfection import LOG_STEP, level_priors, log_share
from identification.gap.evidence.parts import (
    Part,
    evidence_correction,
    log_joint_between,
    log_joints,
)
from identification.gap.evidence.table import EvidenceTable
from identification.gap.explanations.explanation import conditioned
from identification.gap.explanations.fit import _holds
from identification.gap.explanations.priors import prior_of
from identification.gap.explanations.verdict import with_posterior
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import variant
from identification.gap.search.search import _as_stated, search
from identification.gap.words import WORDS
from tests.conformance.effect_benches import quick_engine
from tests.conformance.gap_designs import linear
from tests.unit.test_gap_operators import bench_data


def small_bench() -> Bench:
    rng = np.random.default_rng(3)
    step = np.tile(np.repeat([1, 2, 3, 4], 4), 2)
    repetition = np.repeat([1, 2], 16)
    force = step * 20.0 + rng.normal(0, 0.05, 32)
    u = step * 20.0 * 1.1e-5 + rng.normal(0, 1e-6, 32)
    return make_bench(bench_data(force, u, step=step, repetition=repetition, run=repetition - 1))


def small_engine(bench: Bench, etas: tuple[float, ...] = (0.0, 3e-6)) -> Engine:
    x = bench.load / np.ptp(bench.load)
    bench.add(bench.stacked(1e-5 * x**2))
    bench.add(bench.stacked(1e-5 * np.sin(9 * x)))
    return Engine(bench, base_columns(bench), bench.observed - prediction(bench), np.array(etas))


def dense_covariance(engine: Engine, eta: float, row_part: float = ROW_PART) -> np.ndarray:
    """Noise, holds, levels and base as one covariance of the stacked rows (response only here)."""
    bench = engine.bench
    n = bench.rows.n
    same = bench.rows.hold[:, None] == bench.rows.hold
    sigma2 = bench.sigma**2
    hold = np.outer(bench.noise.hold, bench.noise.hold) * same + (HOLD_PART * eta) ** 2 * same
    part = (row_part * eta) ** 2 / sigma2  # per row, on what differs within a hold
    white = np.diag(sigma2)
    inverse = 1 / np.sqrt(sigma2)
    project = np.zeros((n, n))
    for h in np.unique(bench.rows.hold):
        mine = bench.rows.hold == h
        a = np.where(mine, inverse, 0.0)
        a /= np.linalg.norm(a)
        project += np.diag(mine.astype(float)) - np.outer(a, a)
    root = np.sqrt(sigma2)
    spread = project @ np.diag(part) @ project * np.outer(root, root)
    L = level_columns(bench)
    levels = eta**2 * L @ level_covariance(bench) @ L.T
    base = engine.base.columns * engine.base.sd
    runs = RUN_PART * eta * run_columns(bench)
    return np.asarray(white + hold + spread + levels + runs @ runs.T + base @ base.T)


def test_evidence_is_the_dense_gaussian_marginal() -> None:
    bench = small_bench()
    engine = small_engine(bench)
    offset = None
    for i, extra in ((0, ()), (0, (0,)), (0, (0, 1))):
        cov = dense_covariance(engine, 0.0)
        columns = engine.columns(extra) * 2.0
        cov = cov + columns @ columns.T
        exact = multivariate_normal.logpdf(engine.target, np.zeros(len(cov)), cov)
        level = engine.levels[i]
        found = condition(level, extra, np.eye(len(extra)), 2.0) if extra else level
        if offset is None:
            offset = exact - found.log_base  # constants that all hypotheses share
        assert found.log_base + offset == pytest.approx(exact, abs=1e-5)


def test_levels_of_imperfection_are_exact_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the part of single rows, which is taken row by row; it is left out here."""
    monkeypatch.setattr("identification.gap.evidence.engine.ROW_PART", 0.0)
    engine = small_engine(small_bench())
    exact = []
    for level in engine.levels:
        covariance = dense_covariance(engine, level.eta, row_part=0.0)
        zeros = np.zeros(len(covariance))
        exact.append(multivariate_normal.logpdf(engine.target, zeros, covariance))
    found = [level.log_base for level in engine.levels]
    assert found[1] - found[0] == pytest.approx(exact[1] - exact[0], abs=1e-5)


def large_gap(levels: int) -> Engine:
    """The first column of the pool is really there, thirty times."""
    bench = small_bench()
    small_engine(bench)
    base, n = base_columns(bench), bench.rows.n
    target = bench.observed - prediction(bench)
    target[:n] += 30 * bench.columns[0][:n]
    return Engine(bench, base, target, np.array([0.0, *(1e-6 * 2.5 ** np.arange(levels))]))


def test_levels_that_are_not_looked_at_add_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = large_gap(levels=9)
    shapes = [
        variant(word, word, columns, (3.0, 30.0), positive=positive)
        for word, columns, positive in (
            ("joint_creep", [0], True),
            ("joint_yield", [1], True),
            ("base_slip", [0, 1], False),
            ("time_lag", [0], -np.ones(1)),
            ("contact_seating", [0, 1], np.array([1.0, -1.0])),
        )
    ]
    looked, look = [], EvidenceTable.look
    monkeypatch.setattr(
        EvidenceTable, "look", lambda self: (look(self), looked.append(self.logs))[0]
    )
    few = [s.log_evidence for s in score(engine, engine.levels, shapes)]
    assert any(np.isneginf(logs).any() for logs in looked)
    looked.clear()
    monkeypatch.setattr(table, "_COUNTS", np.inf)
    every = [s.log_evidence for s in score(engine, engine.levels, shapes)]
    assert not any(np.isneginf(logs).any() for logs in looked)
    assert few == pytest.approx(every, rel=1e-12)


def test_far_worse_shapes_of_a_word_are_not_looked_at_further(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine = large_gap(levels=3)
    right = variant("joint_creep", "right", [0], (3.0, 30.0))
    near = variant("joint_creep", "near", [0], (2.0, 8.0))
    wrong = variant("joint_creep", "wrong", [1], (3.0, 30.0))
    shapes = [right, near, wrong]
    looked, make = [], EvidenceTable._make
    monkeypatch.setattr(
        EvidenceTable,
        "_make",
        lambda self, i, which: (make(self, i, which), looked.extend(which))[0],
    )
    few = [s.log_evidence for s in score(engine, engine.levels, shapes)]
    assert few[0] > few[2] + 90
    assert looked.count(2) == 1 < looked.count(1)
    monkeypatch.setattr(table, "_HOPELESS", np.inf)
    every = [s.log_evidence for s in score(engine, engine.levels, shapes)]
    assert few[:2] == pytest.approx(every[:2], rel=1e-12)


def test_score_averages_over_scales_and_asks_for_the_sign() -> None:
    bench = small_bench()
    engine = small_engine(bench)
    # an effect of that shape is really there, at three times the noise
    engine.target[: bench.rows.n] += 0.3 * bench.columns[0][: bench.rows.n]
    engine = Engine(bench, engine.base, engine.target, np.array([0.0, 3e-6]))
    free = variant("joint_creep", "free", [0], (1.0,), positive=False)
    signed = variant("joint_creep", "signed", [0], (1.0,))
    negative = variant("joint_creep", "negative", [0], (1.0,), positive=-np.ones(1))
    a, b, c = (s.log_evidence for s in score(engine, engine.levels, [free, signed, negative]))
    assert np.logaddexp(b, c) - np.log(2) == pytest.approx(a, abs=0.05)
    assert abs(b - c) > 1.0  # the column is there with one sign, and that one is known


def test_shapes_of_different_sizes_score_together_as_alone() -> None:
    """Those of nearby sizes go through in one batch, padded to the largest of it."""
    bench = small_bench()
    for bend in (2.0, 3.0, 4.0):
        bench.add(bench.stacked(1e-5 * np.sin(bend * bench.load / 20.0)))
    engine = small_engine(bench)
    mixed = [
        variant(
            "joint_yield", "four", [0, 1, 2, 3], (0.5, 2.0), root=np.diag([1.0, 0.5, 0.2, 0.1])
        ),
        variant("base_slip", "five", [0, 1, 2, 3, 4], (0.1, 1.0, 9.0), least=0.3, each=True),
        variant(
            "joint_yield",
            "three and a sum",
            [2, 3, 4],
            (1.0,),
            positive=np.ones(3),
            within=np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]),
        ),
        variant("joint_yield", "either sense", [1, 2, 3, 4, 0], (1.0, 3.0), positive=False),
    ]
    together = score(engine, engine.levels, mixed)
    engine.stacks.clear()
    for v, found in zip(mixed, together, strict=True):
        (alone,) = score(engine, engine.levels, [v])
        assert found.log_evidence == pytest.approx(alone.log_evidence, rel=1e-12)
        assert (found.scale, found.level) == (alone.scale, alone.level)


def test_priors_of_all_sets_up_to_two_sum_below_one() -> None:
    n = len(WORDS)
    none, one = frozenset[str](), frozenset({"joint_yield"})
    two = one | {"joint_creep"}
    total = np.exp(prior_of(none)) + n * np.exp(prior_of(one))
    total += n * (n - 1) / 2 * np.exp(prior_of(two))
    assert 0.85 < total < 1.0


def test_probabilities_cover_all_words_and_sum_to_one() -> None:
    bench = small_bench()
    base = base_columns(bench)
    variants = library(bench)
    engine = Engine(bench, base, bench.observed - prediction(bench), np.array([0.0, 1e-6, 3e-6]))
    found = with_posterior(search(engine, variants), {})
    assert set(found.probabilities) == {*WORDS, "none", "unknown"}
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    assert found.explanations[0].parts == ()  # a spring 10 % off, stated within 10 %


def test_words_that_need_an_arm_are_never_given_without_one() -> None:
    words = {v.word for v in library(small_bench())}
    assert not words & {"link_flexibility", "base_compliance", "base_slip", "pose_error"}


@pytest.mark.parametrize("step", [2.5, 6.25])
def test_levels_of_imperfection_are_bins_about_them(step: float) -> None:
    """Of any grid: sizes within half a step of a level have its share of the prior."""
    etas = np.concatenate([[0.0], 1e-6 * step ** np.arange(6)])
    half = 0.5 * np.log(step)
    for i in (1, 2, 3):
        edges = np.log(etas[i]) + np.array([-half, half])
        alone = float(log_share(etas, edges, (3e-6 / 0.04) ** 2)[0])
        assert level_priors(etas, (3e-6 / 0.04) ** 2)[i] == pytest.approx(alone, abs=1e-9)


def test_fit_and_evidence_take_one_imperfection_of_a_hold() -> None:
    """Of a running recording, too: what a stretch has to itself."""
    for name, part in (("bench imposed", 0.6), ("medium", HOLD_PART)):
        bench = make_bench(linear(name))
        engine = quick_engine(bench)
        assert hold_part(bench.rows) == part
        _, common = _holds(engine, 2e-6)
        wanted = np.hypot(bench.noise.hold, part * 2e-6)
        np.testing.assert_allclose(common[: bench.rows.n], wanted)


def test_none_is_looked_at_between_the_levels_as_well() -> None:
    """Levels that scatter by a little less than the first size of imperfection."""
    bench, rng = small_bench(), np.random.default_rng(2)
    target = bench.observed - prediction(bench)
    target[: bench.rows.n] += 4e-7 * rng.normal(size=bench.rows.level.max() + 1)[bench.rows.level]
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))
    sizes = 3e-6 * np.exp(-LOG_STEP * np.arange(6, -1, -1) / 3)
    between = [log_joint_between(engine, (), float(eta)) for eta in sizes]
    less = 0.2  # a bench whose noise is known to a factor
    wanted = log_mean([engine.levels[0].log_base, *between], [1 - less, *[less / 7] * 7])
    assert _as_stated(engine) == pytest.approx(wanted, abs=1e-6)
    assert max(between[:3]) > between[3] + 1.0  # which the levels alone would not see


def test_effects_are_as_likely_together_in_whichever_order_they_are_added() -> None:
    """A curve alone does what a second effect beside it then need not: its imperfection is judged
    by what is left to it."""
    bench = small_bench()
    engine = small_engine(bench, (0.0, 5e-7, 1.25e-6, 3e-6))
    x = bench.load / np.ptp(bench.load)
    target = engine.target + bench.stacked(3e-5 * x**2 - 2.9e-5 * x**3)
    bench.add(bench.stacked(1e-5 * x**3))
    engine = Engine(bench, engine.base, target, engine.etas)
    parts = tuple(
        Part(variant(word, word, [k], (3.0,), positive=False), 3.0)
        for word, k in (("joint_nonlinear_stiffness", 0), ("contact_seating", 2))
    )
    found, off = [], []
    for one, other in (parts, parts[::-1]):
        levels, energy = conditioned(engine, (one,))
        (scored,) = score(engine, levels, [other.variant], energy)
        together = log_joints(engine, (one, other))
        off.append(evidence_correction(engine, (one, other), energy, together))
        found.append(scored.log_evidence + off[-1])
    assert found[0] == pytest.approx(found[1], abs=1e-6)
    assert abs(off[0] - off[1]) > 0.1
