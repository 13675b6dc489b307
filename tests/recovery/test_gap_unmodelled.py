"""What no word names and many rigs have: called unknown, and said what it looks like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identification.gap.data import GapData
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.explanations.explanation import GapPattern
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.search.unmodelled_shapes import KINDS as KINDS_OF_STRANGERS
from identification.gap.search.unmodelled_shapes import likenesses, square_of, unmodelled_variants
from identification.gap.words import UNMODELLED
from rig.diagnosis.diagnose_text import LOOKS_LIKE, looks_like, render
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import (
    DESIGNS,
    TRUE,
    Array,
    Design,
    imported,
    levers,
    linear,
    meta,
    noisy,
)
from tests.explained import explained
from tests.slow import slow_ones

SIZE_M = 30e-6
SMALL = Design(repetitions=2, steps=7, hold=3)
Added = Callable[[pd.DataFrame], Array]  # (n,) displacement, of about 1


def measured(added: Added, size: float = SIZE_M, design: Design = SMALL) -> GapData:
    """A linear rig, and what is added to its displacement."""

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        return size * added(rows), np.zeros((len(rows), 6))

    return gap_data(imported(noisy(design, law), meta(design)))


def run_of(rows: pd.DataFrame) -> Array:
    """(n,) number of the run."""
    return np.asarray(rows.groupby(["pose", "direction", "repetition"], sort=False).ngroup())


def share_of(rows: pd.DataFrame) -> Array:
    """(n,) load, of the largest in its direction."""
    force = rows["force_N"].abs()
    return np.asarray(force / force.groupby(rows["direction"]).transform("max"))


def swing(period: float) -> Added:
    return lambda rows: np.asarray(np.sin(2 * np.pi * rows["session_s"] / period + 1.0))


def wave(length: float) -> Added:
    """Over the elastic stroke, m."""

    def added(rows: pd.DataFrame) -> Array:
        stroke = np.sum(levers(rows) ** 2 / TRUE, axis=1) * rows["force_N"].to_numpy(float)
        return np.asarray(np.sin(2 * np.pi * stroke / length + 0.5))

    return added


def slopes(rows: pd.DataFrame) -> Array:
    each = np.array([1.0, -0.8, 0.4, -1.0, 0.9, -0.3])
    return np.asarray(each[run_of(rows).astype(int) % len(each)] * share_of(rows))


def rough(rows: pd.DataFrame) -> Array:
    off = np.random.default_rng(3).standard_normal(100)
    return np.asarray(off[np.round(20 * share_of(rows)).astype(int)] - off[0])


def jumps(rows: pd.DataFrame) -> Array:
    """In half of the holds, anew in every run."""
    random, out = np.random.default_rng(4), np.zeros(len(rows))
    holds = rows.groupby(["pose", "direction", "repetition", "branch", "step"], sort=False)
    hold, run = holds.ngroup().to_numpy(), run_of(rows)
    for k in np.unique(hold):
        if random.random() < 0.5 and np.any(hold < k):
            out[(hold >= k) & (run == run[hold == k][0])] += random.choice([-0.6, 0.6])
    return out


def settles(rows: pd.DataFrame) -> Array:
    """The stand goes on under the load, by a time of 20 s, and goes back between the runs."""
    share, run = share_of(rows), run_of(rows)
    kept = np.exp(-np.diff(rows["session_s"], prepend=0.0) / 20.0)
    load = np.where(np.diff(run, prepend=-1) == 0, share, 0.0)
    out = np.zeros(len(rows))
    for i in range(1, len(rows)):
        out[i] = load[i] + kept[i] * (out[i - 1] - load[i])
    return out


KINDS: dict[str, Added] = {
    "settles": settles,
    "jumps": jumps,
    "swings": swing(61.0),
    "slopes": slopes,
    "rough": rough,
}


@pytest.mark.parametrize("kind", slow_ones(KINDS, ("jumps", "rough", "swings")))
def test_what_no_word_names_is_unknown_and_told(kind: str) -> None:
    result = explained(measured(KINDS[kind]))
    assert result.verdict == "unknown"
    like = result.looks_like
    assert like is not None
    assert like.kind == kind
    assert looks_like(like) in render(result)
    if kind == "swings":
        assert like.period == pytest.approx(61.0, rel=0.01)
        assert "61" in looks_like(like)


FINE = Design(repetitions=2, steps=16, hold=1, readings=False)
LONG_HOLDS = Design(repetitions=2, steps=7, hold=6, readings=False)


@pytest.mark.slow
def test_a_wave_over_the_stroke_is_found_with_its_length() -> None:
    result = explained(measured(wave(0.31e-3), design=FINE))
    assert result.verdict == "unknown"
    like = result.looks_like
    assert like is not None
    assert like.kind == "waves"
    assert like.period == pytest.approx(0.31e-3, rel=0.02)
    assert "mm long" in looks_like(like)


@pytest.mark.slow
def test_a_hum_that_is_read_once_a_second_is_a_fast_swing() -> None:
    """Hardly slower than the readings of a hold, which scatter by it."""
    like = explained(measured(swing(5.26), 8e-6, LONG_HOLDS)).looks_like
    assert like is not None
    assert like.kind == "swings"
    assert like.period == pytest.approx(5.26, rel=0.01)


def test_fast_samples_in_a_long_session_have_no_end_of_swings() -> None:
    """A thousand readings a second, and pauses of an hour."""
    data = measured(swing(5.26), 16e-6, LONG_HOLDS)
    assert data.session is not None
    hour = 3600.0 * data.run
    bench = make_bench(replace(data, time=1e-3 * data.time, session=1e-3 * data.session + hour))
    assert bench.noise.raised > 1.0
    base, target = base_columns(bench), bench.observed - prediction(bench)
    swings = [v for v in unmodelled_variants(bench, base, target) if v.word == "swings"]
    looked_at = 1 / swings[0].prior
    assert looked_at < 10 * bench.rows.n


def test_below_the_noise_there_is_no_gap() -> None:
    """However plainly many samples show it."""
    assert explained(measured(swing(61.0), 1.2e-6, DESIGNS["medium"])).verdict == "none"


def test_waves_fit_into_the_shortest_stroke_at_least_twice() -> None:
    """Longer ones are curves: of each setup its own, as the phases are free."""
    bench = make_bench(measured(wave(1.1e-3), design=FINE))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    waves = [v for v in unmodelled_variants(bench, base, target) if v.word == "waves"]
    strokes = [np.ptp(bench.line[bench.rows.setup == s]) for s in range(2)]
    assert waves
    assert max(v.info["period"] for v in waves) < min(strokes) / 2.2


def test_periods_that_were_not_looked_at_count_as_looked_at_in_vain() -> None:
    bench = make_bench(measured(swing(61.0)))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    swings = [v for v in unmodelled_variants(bench, base, target) if v.word == "swings"]
    engine = Engine(bench, base, target, eta_levels(bench, base, target))
    (like,) = likenesses(engine, swings)
    each = [s.log_evidence for s in score(engine, engine.levels, swings)]
    assert sum(v.prior for v in swings) < 0.2
    assert like.log_evidence == pytest.approx(float(np.logaddexp.reduce(each)))


@pytest.mark.parametrize("name", ["medium", "paper", "bench"])
def test_nothing_strange_is_seen_in_noise(name: str) -> None:
    result = explained(linear(name))
    assert result.verdict == "none"
    assert result.looks_like is None


@pytest.mark.slow
def test_slow_swings_are_left_to_the_drifts() -> None:
    """One and a half periods over the session are a warm-up and what follows."""
    span = float(np.ptp(measured(slopes).session))
    result = explained(measured(swing(span / 1.5)))
    assert result.verdict == "thermal_drift"


def test_a_coarse_clock_shows_no_settling() -> None:
    """Times to the half hour."""
    data = linear("paper")
    coarse = 1800.0 * (np.arange(len(data.time)) >= len(data.time) // 2)
    bench = make_bench(replace(data, time=coarse, session=coarse))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    assert not any(v.word == "settles" for v in unmodelled_variants(bench, base, target))


def test_what_settles_without_an_arm_is_its_spring() -> None:
    data = measured(settles)
    alone = replace(linear("bench"), session=None)
    for each, seen in ((data, True), (alone, False)):
        bench = make_bench(each)
        base, target = base_columns(bench), bench.observed - prediction(bench)
        assert any(v.word == "settles" for v in unmodelled_variants(bench, base, target)) is seen


def test_every_kind_has_its_words() -> None:
    for kind in LOOKS_LIKE:
        like = GapPattern("slopes" if kind == "wanders" else kind, 0.01, 0.0, kind == "wanders")
        assert looks_like(like)
    assert len(LOOKS_LIKE) == KINDS_OF_STRANGERS + len(UNMODELLED)  # both know what wanders
    assert set(UNMODELLED) < set(LOOKS_LIKE)


def test_what_periods_take_is_what_least_squares_takes() -> None:
    """Beside a base that has a slow swing already, in two stretches of rows."""
    n, count = 120, np.linspace(0.5, 9.0, 70)
    rng = np.random.default_rng(2)
    phase, white = np.sort(rng.random(n)), rng.uniform(0.5, 2.0, n)
    first = np.arange(n) < 50
    masks = [first.astype(float), 1.0 - first]
    swing = np.sin(2 * np.pi * count[0] * phase) * masks[0]
    known = np.linalg.qr(np.column_stack([np.ones(n), phase, swing]) * white[:, None])[0]
    left = rng.normal(size=n)
    left -= known @ (known.T @ left)
    found = square_of(known, left, white, phase, masks, count)
    for number, square in zip(count, found, strict=True):
        turn = 2 * np.pi * number * phase
        both = np.column_stack([m * f * white for m in masks for f in (np.sin(turn), np.cos(turn))])
        both -= known @ (known.T @ both)
        fitted = both @ np.linalg.lstsq(both, left, rcond=1e-6)[0]
        assert square == pytest.approx(float(fitted @ left), rel=1e-6)
