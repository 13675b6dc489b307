"""What a hand on the screw does: it goes its own way between levels, or drives the displacement."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest

from identification.arrays import Array, Flags
from identification.gap.data import GapData
from identification.gap.evidence.imperfection import PATH
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import fit
from identification.gap.judging import unread_ramps
from identification.gap.judging.unread_ramps import acts_only_after_overshoot, unread_ramp_error
from identification.gap.model.bench import make_bench
from rig.diagnosis.gap_data import gap_data
from tests.conformance.effect_benches import of, quick_engine
from tests.conformance.gap_designs import DESIGNS, TRUE, imported, meta, noisy
from tests.conformance.test_effect_recovery import typical
from tests.explained import explained

LATE_S = 1.3


def in_strokes(share: Array, first: Array) -> Array:
    """How far a screw is at a share of its way: in two strokes, of which the first is that large,
    with a pause for a new grip between them."""
    done = np.where(share < 0.4, first * share / 0.4, first)
    return np.asarray(np.where(share > 0.6, first + (1 - first) * (share - 0.6) / 0.4, done))


def behind(rows: pd.DataFrame) -> Array:
    """(n,) N by which a reading lags that shows what was LATE_S ago. A hand takes 5 s from level to
    level, each time in another way, and comes to rest half a second before the first reading."""
    rng, force = np.random.default_rng(5), rows["force_N"].to_numpy(float)
    change = np.diff(force, prepend=force[0])
    change[rows["time_s"].diff().fillna(-1.0).to_numpy() < 0] = 0.0  # minutes between two runs
    first = rng.uniform(0.2, 0.8, len(rows))
    number = (rows["step"].diff().fillna(1.0) != 0) | (rows["branch"] != rows["branch"].shift())
    hold = number.cumsum().to_numpy()
    start = np.flatnonzero(np.diff(hold, prepend=-1))
    since = np.arange(len(rows)) - start[hold - hold[0]] + 0.5 - LATE_S  # s since the hand rests
    share = np.clip(1 + since / 5.0, 0.0, 1.0)
    step = change[start][hold - hold[0]]
    return step * (in_strokes(share, first[start][hold - hold[0]]) - 1)


def late_laser(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """The laser shows what was before."""
    return np.sum(lever**2 / TRUE, axis=1) * behind(rows), np.zeros((len(rows), 6))


def lagging(channel: str) -> GapData:
    design = DESIGNS["medium"]
    table = noisy(design, late_laser if channel == "displacement" else None)
    if channel == "force":
        table["force_N"] += behind(table.assign(force_N=np.round(table["force_N"])))
    return gap_data(imported(table, meta(design)))


@pytest.mark.slow
@pytest.mark.parametrize("channel", [pytest.param("displacement", marks=pytest.mark.slow), "force"])
def test_a_lag_is_one_however_the_hand_went(channel: str) -> None:
    found = explained(lagging(channel))
    assert found.verdict == "time_lag"
    assert found.fit.parts[0].variant.info["channel"] == channel
    if channel == "force":  # which is known again as soon as it stands
        assert found.after < 1.1 * found.noise
    lag = found.effects[0].parameters["lag"]
    assert lag.low < LATE_S < lag.high  # it says how little the way tells


def test_only_where_a_lag_acts_does_the_hand_count() -> None:
    bench, variants, _ = of("time_lag", "medium")
    engine = quick_engine(bench)
    v = next(v for v in variants if v.info["channel"] == "displacement")
    fitted = fit(engine, Explanation((Part(v, 1.0),), 0.0, 0.0, (0.0,), 0.0))
    does = np.abs(fitted.contribution(engine, 0)[: bench.rows.n])
    np.testing.assert_allclose(unread_ramp_error(engine, fitted), PATH * does)
    bench, variants, _ = of("joint_creep", "medium")
    engine = quick_engine(bench)
    creeps = fit(engine, Explanation((Part(typical(variants), 0.1),), 0.0, 0.0, (0.0,), 0.0))
    assert not unread_ramp_error(engine, creeps).any()


def test_what_acts_at_other_levels_too_is_a_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not what acts in the holds alone beyond which a hand went."""
    bench, _, _ = of("time_lag", "medium")
    edges, rows = bench.rows.edges, bench.rows
    gone = np.zeros(rows.n)
    gone[edges[3::6]] = 0.1
    there = np.isin(rows.hold, rows.hold[gone != 0])
    load = bench.load

    def of_rows(gone: Array) -> SimpleNamespace:
        rows, layout = replace(bench.rows, overshoot=gone), bench.layout
        return SimpleNamespace(bench=SimpleNamespace(rows=rows, load=load, layout=layout))

    engine = of_rows(gone)

    def alone(
        moved: Array,
        parts: tuple[int, ...] = (0,),
        elsewhere: Array | None = None,
        sd: float = 1.0,
    ) -> bool:
        """elsewhere: what the other holds alone say of it, a coefficient of 1 and its sd."""
        w = np.ones(1), np.full((1, 1), sd**2)

        def fitted(_: object, __: object, keep: Flags | None = None) -> SimpleNamespace:
            if keep is not None:  # of what is read hold by hold, too
                np.testing.assert_array_equal(keep[: rows.n], ~there)
                held = keep[bench.layout.q].reshape(bench.data.joints, -1)
                np.testing.assert_array_equal(held, np.tile(~there[edges], (len(held), 1)))
            does = moved if keep is None or elsewhere is None else elsewhere
            return SimpleNamespace(contribution=lambda *_: does, of=lambda _: w)

        monkeypatch.setattr(unread_ramps, "fit", fitted)
        best = SimpleNamespace(parts=parts)
        found = SimpleNamespace(engine=engine, explanations=(best,))
        return acts_only_after_overshoot(cast(SearchResult, found))

    signs = np.where(np.arange(rows.n) % 2, 1.0, -1.0)
    assert alone(signs * there)
    assert not alone(signs * there, parts=())
    assert not alone(signs * (there + 1.0))
    assert not alone(signs)
    # nor where the others say the same of it, for sure
    both = signs * (there + 0.2)
    assert alone(both)
    assert not alone(both, sd=0.05)
    assert not alone(both, elsewhere=1.1 * both, sd=0.05)
    assert alone(both, elsewhere=1.5 * both, sd=0.05)
    assert alone(signs * there, sd=0.05)
    large = load > 0.7 * load.max()
    engine = of_rows(np.where(np.isin(np.arange(rows.n), edges) & large, 0.1, 0.0))
    assert not alone(load**3)  # as any law it acts at large loads


def test_a_recording_that_runs_on_shows_the_way() -> None:
    bench, variants, _ = of("time_lag", "bench imposed")
    engine = quick_engine(bench)
    fitted = fit(engine, Explanation((Part(variants[0], 1.0),), 0.0, 0.0, (0.0,), 0.0))
    assert np.abs(fitted.contribution(engine, 0)).max() > 0
    assert not unread_ramp_error(engine, fitted).any()


def test_where_the_displacement_is_imposed_it_is_the_force_that_scatters() -> None:
    """Levels of a stroke: each row answers with a force, of its uncertainty over the stiffness."""
    design, rng = replace(DESIGNS["bench"], imposed="displacement"), np.random.default_rng(4)
    plain = gap_data(imported(noisy(design), meta(design)))
    coarse = replace(plain.instruments, force=2.0)
    force = plain.force + rng.normal(0, coarse.force, len(plain.force))
    bench = make_bench(replace(plain, force=force, instruments=coarse))
    meter, slope = coarse, bench.stated_slope
    wanted = np.hypot(slope * meter.force, meter.displacement)
    noise = bench.noise.response * np.sqrt(bench.rows.weight)
    assert np.all(noise > 0.3 * wanted)
    assert np.all(noise < 1.2 * wanted)
    assert bench.noise.stated == pytest.approx(float(np.median(wanted)))
