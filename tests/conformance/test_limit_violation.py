"""Explanations whose coefficients their own words exclude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging import limit_violation as judging
from identification.gap.judging.limit_violation import limit_violation
from identification.gap.model.variants import Variant
from tests.conformance.effect_benches import of, quick_engine
from tests.conformance.test_effect_recovery import strength, with_effect
from tests.explained import explained


def frictions() -> tuple[Engine, Variant]:
    """Friction of many strengths, each of which only holds."""
    bench, variants, _ = of("joint_hysteresis", "rich")
    return quick_engine(bench), next(v for v in variants if v.form == "spectrum" and v.each)


def off(engine: Engine, v: Variant, w: Array, monkeypatch: pytest.MonkeyPatch, sd: Array) -> float:
    """How far friction of strengths w is off that are known to sd (k,), its laws being exact and
    the gap next to none."""
    one = Explanation((Part(v, 0.1),), 0.0, 0.0, (0.0,), 0.0)
    plain = fit(engine, one)
    joint = np.diag(np.append(np.zeros(len(plain.base)), sd**2))
    known = replace(plain, coefficients=w, covariance=np.diag(sd**2), joint_covariance=joint)
    monkeypatch.setattr(judging, "fit", lambda *_, **__: known)
    engine.structural = 1e-9
    return limit_violation(engine, one, known)[0]


def test_what_keeps_its_limits_breaks_none(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, v = frictions()
    k = len(v.columns)
    assert off(engine, v, np.full(k, 0.1), monkeypatch, np.full(k, 1e-3)) == 0.0
    nothing = Explanation((), 0.0, 0.0, (), 0.0)
    assert limit_violation(engine, nothing, fit(engine, nothing)) == (0.0, "")


def test_friction_that_pushes_is_as_far_off_as_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, v = frictions()
    w, sd = np.full(len(v.columns), 0.1), np.full(len(v.columns), 1e-3)
    w[0], sd[0] = -1.2e-2, 2e-3
    assert off(engine, v, w, monkeypatch, sd) == pytest.approx(6.0 / 5.5)
    assert off(engine, v, w, monkeypatch, 1e3 * sd) < 0.01  # nobody knows


def test_many_limits_that_are_broken_a_little_count_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, v = frictions()
    w, sd = np.full(len(v.columns), 0.1), np.full(len(v.columns), 1e-3)
    w[:4] = -3e-3  # 3 times the root of four
    assert off(engine, v, w, monkeypatch, sd) == pytest.approx(6.0 / 5.5)


def test_what_hardly_moves_the_target_breaks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """However surely: by the share of the gap that is missed where the limit is kept."""
    engine, v = frictions()
    w, sd = np.full(len(v.columns), 0.1), np.full(len(v.columns), 1e-3)
    w[3] = -0.05
    assert off(engine, v, w, monkeypatch, sd) == pytest.approx(50.0 / 5.5)
    moved = engine.bench.rows.rms(0.05 * engine.columns([v.columns[3]])[: engine.bench.rows.n, 0])
    engine.structural = moved / 0.05
    one = Explanation((Part(v, 0.1),), 0.0, 0.0, (0.0,), 0.0)
    known = vars(judging)["fit"](engine, one)  # as `off` had it
    assert limit_violation(engine, one, known)[0] == pytest.approx(0.05 / 0.06)


def test_all_else_follows_where_a_limit_is_kept() -> None:
    """What the springs can do for a part of an effect is not missed."""
    engine, v = frictions()
    one = Explanation((Part(v, 0.1),), 0.0, 0.0, (0.0,), 0.0)
    fitted = fit(engine, one)
    by = 0.05 * np.eye(len(v.columns))[-1]  # what never slips is a spring
    alone = engine.columns([v.columns[-1]])[: engine.bench.rows.n, 0] * 0.05
    rows = engine.bench.rows
    assert rows.rms(fitted.moved(engine, 0, by)) < 0.5 * rows.rms(alone)


def test_a_floor_counts_and_a_bench_has_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a rig without an arm a part may be off by a share of its largest coefficient, too."""
    engine, v = frictions()
    k = len(v.columns)
    held = replace(v, positive=None, each=(), within=np.eye(k)[:1], floor=np.full(1, 0.2))
    w, sd = np.full(k, 0.1), np.full(k, 0.02)
    assert off(engine, held, w, monkeypatch, sd) == pytest.approx(5.0 / 5.5)
    bench = replace(engine.bench, data=replace(engine.bench.data, arm=False))
    monkeypatch.setattr(engine, "bench", bench)
    met = np.hypot(0.02, 0.05 * 0.1)
    assert off(engine, held, w, monkeypatch, sd) == pytest.approx(0.1 / met / 5.5)


def test_a_law_errs_alike_along_its_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, v = frictions()
    one = Explanation((Part(v, 0.1),), 0.0, 1e-5, (0.0,), 0.0)
    asked: list[bool] = []

    def noted(_: Engine, explanation: Explanation, *, alike: bool = False) -> Fit:
        asked.append(alike)
        return fit(engine, explanation)

    monkeypatch.setattr(judging, "fit", noted)
    limit_violation(engine, one, fit(engine, one))
    assert asked == [True]


def test_of_several_parts_the_one_that_is_farthest_off_counts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, v = frictions()
    monkeypatch.setattr(judging, "_off", lambda *a: (0.5, 1.5)[a[-1]])
    other = replace(v, word="joint_yield")
    two = Explanation((Part(v, 0.1), Part(other, 0.1)), 0.0, 0.0, (0.0,) * 2, 0.0)
    assert limit_violation(engine, two, fit(engine, two)) == (1.5, "joint_yield")


@pytest.mark.parametrize(
    ("eta", "size", "left", "taken"),
    [(0.0, 1e-3, 0.0, 3e-5), (0.0, 1e-3, 5e-5, 5e-5), (1e-4, 1e-3, 5e-5, 1e-4)],
)
def test_laws_count_as_no_better_met_than_they_are(
    monkeypatch: pytest.MonkeyPatch, eta: float, size: float, left: float, taken: float
) -> None:
    """What an effect does is known to three hundredths of that, whatever readings there are, and to
    what they leave."""
    engine, v = frictions()
    one = Explanation((Part(v, 0.1),), 0.0, eta, (size,), 0.0)
    fitted, asked = fit(engine, one), []

    def noted(_: Engine, explanation: Explanation, **__: bool) -> Fit:
        asked.append(explanation.eta)
        return fitted

    monkeypatch.setattr(judging, "fit", noted)
    monkeypatch.setattr(judging, "excess_response_rms", lambda *_: left)
    limit_violation(engine, one, fitted)
    assert asked == [pytest.approx(taken)]


@pytest.mark.slow
@pytest.mark.parametrize("withheld", [True, False])
def test_a_joint_that_yields_does_not_rub(withheld: bool) -> None:
    """At half of the load, and nothing before: friction of that one strength fits as well."""
    bench, variants, columns = of("joint_yield", "rich")
    v = next(v for v in variants if v.label == "joint 1 lasting at 0.6 sharp")
    w = strength(bench, v, columns, 30.0)
    data = with_effect("rich", v, columns[:, list(v.columns)] @ w, bench)
    found = explained(data, withhold=["joint_yield"] if withheld else [])
    assert found.verdict == ("unknown" if withheld else "joint_yield")
    assert any("outside what that word allows" in n for n in found.notes) is withheld
