"""What acts through the joints' springs, laid about the springs as they are found to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.forms import law_of, rows_of
from identification.gap.data import GapData
from identification.gap.effects import EFFECTS, library
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.model.variants import Variant
from identification.gap.search.refine import refine
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING

SOFTER = np.array([1.25, 0.8, 1.2, 0.85, 1.1, 1.0])


ASKEW, LATE = ("load_misalignment", "all directions"), ("time_lag", "force filter 1.25 s")


def shape(bench: Bench, of: tuple[str, str]) -> Variant:
    """A word's variant with that label."""
    word, label = of
    return next(v for v in library(bench, [word]) if v.label == label)


@pytest.mark.parametrize("of", [ASKEW, LATE])
def test_columns_about_other_springs_are_those_of_a_rig_with_these_springs(
    of: tuple[str, str],
) -> None:
    data = arm_data()
    bench = make_bench(data)
    v = shape(bench, of)
    about = EFFECTS[v.word].laws.about_springs(bench, v, bench.compliance * SOFTER)
    there = make_bench(data, compliance=bench.compliance * SOFTER)
    wanted = shape(there, of)
    assert about.label != v.label
    for mine, other in zip(about.columns, wanted.columns, strict=True):
        np.testing.assert_allclose(bench.columns[mine], there.columns[other], rtol=1e-9, atol=1e-18)
    # and its law, on any bench, counts from them
    law, unit = law_of(bench, about)
    made = rows_of(make_bench(data), about.word, law) * unit
    for mine, column in zip(about.columns, made.T, strict=True):
        np.testing.assert_allclose(bench.columns[mine], column, rtol=1e-9, atol=1e-18)


def through_others(data: GapData, of: tuple[str, str], size: float) -> GapData:
    """Springs that are off and what acts through them: what was measured is linear in neither."""
    there = make_bench(data, compliance=data.compliance * SOFTER)
    v = shape(there, of)
    effect = size * sum(there.columns[c] for c in v.columns)
    total = prediction(there) + effect
    rows, layout = there.rows, there.layout
    count = rows.weight.astype(int)
    noise = data.displacement - 1.1e-5 * data.force
    assert data.q is not None
    assert data.tangential is not None
    holds = np.add.reduceat(count, np.flatnonzero(rows.hold_starts))
    q = np.repeat(total[layout.q].reshape(data.joints, -1).T, holds, axis=0)
    across = np.repeat(total[layout.tangential].reshape(2, -1).T, holds, axis=0)
    return replace(
        data,
        displacement=np.repeat(total[: rows.n], count) + noise,
        q=data.q + q,
        tangential=data.tangential + across,
    )


@pytest.mark.parametrize(("of", "size"), [(ASKEW, 0.25), (LATE, 1.0)])
def test_what_acts_on_springs_that_are_off_is_met_by_a_finer_shape(
    of: tuple[str, str], size: float
) -> None:
    data = through_others(arm_data(), of, size)
    bench = make_bench(data)
    variants = library(bench, [of[0]])
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 4e-6, 2e-5]))
    singles = score(engine, engine.levels, variants)
    finer = refine(engine, singles)
    before = max(s.log_evidence for s in singles)
    after = max(s.log_evidence for s in score(engine, engine.levels, finer))
    assert after > before + 20


def test_every_component_of_the_force_that_is_recorded_drifts() -> None:
    """Also those that no direction loads: their amplifiers drift as well, and show it."""
    data = arm_data(directions="x")

    def names(seen: GapData) -> set[tuple[str, ...]]:
        bench = replace(make_bench(seen), columns=Pool())
        return {tuple(v.info["names"]) for v in library(bench, ["force_drift"])}

    assert names(data) == {("",), ("x", "y", "z")}
    assert names(replace(data, tangential=None)) == {("",)}


def test_amplifiers_that_drift_alike_are_no_second_free_path() -> None:
    """Where no component is recorded, and no direction pushed back."""
    data = replace(arm_data(), tangential=None)
    for one_way in (True, False):
        first, *others = data.setups
        turned = replace(others[0], unit_vector=-first.unit_vector)
        bench = make_bench(data if one_way else replace(data, setups=(first, turned, *others[1:])))
        columns = [v.columns for v in library(bench, ["force_drift"])]
        assert len(set(columns)) == len(columns)
        assert (
            any(v.label.endswith("all components") for v in library(bench, ["force_drift"]))
            is not one_way
        )


def test_every_amplifier_may_drift_at_several_rates_of_its_own() -> None:
    """A push against an axis reads its amplifier the other way round than one along it."""
    data = replace(arm_data(), tangential=None)
    t = data.session - data.session[0]
    quick, slow = (1 - np.exp(-t / (share * t[-1])) for share in (0.02, 0.12))
    y = np.array([s.direction == "y" for s in data.setups])[data.setup]
    drift = 30.0 * quick - 40.0 * slow
    bench = make_bench(replace(data, force=data.force + np.where(y, -drift, drift)))
    variants = library(bench, ["force_drift"])
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 4e-6, 2e-5]))
    found = score(engine, engine.levels, variants)
    best, *others = sorted(found, key=lambda s: -s.log_evidence)
    assert best.variant.label == "rates, each component"
    assert best.log_evidence > others[0].log_evidence + 100


def test_amplifiers_that_drift_alike_show_it_across_the_push_as_well() -> None:
    data = arm_data()
    t = (data.session - data.session[0]) / np.ptp(data.session)
    drift = 4.0 * np.sin(5.0 * t) + 2.0 * np.sin(14.0 * t)
    across = np.stack([s.tangents.sum(axis=1) for s in data.setups])[data.setup]
    assert data.tangential is not None
    seen = data.tangential + across * drift[:, None]
    bench = make_bench(replace(data, force=data.force + drift, tangential=seen))
    variants = library(bench, ["force_drift"])
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 4e-6, 2e-5]))
    best, *others = sorted(score(engine, engine.levels, variants), key=lambda s: -s.log_evidence)
    assert best.variant.label == "winding path, all components"
    assert best.log_evidence > others[0].log_evidence + 50
    law, scale = law_of(bench, best.variant)
    exact = np.stack([bench.columns[c] for c in best.variant.columns], axis=1)
    assert rows_of(bench, "force_drift", law) * scale == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("tare", ["session", "run"])
def test_amplifiers_that_one_cause_drives_show_at_rest_how(tare: str) -> None:
    data = replace(arm_data(), tare=tare)
    t = (data.session - data.session[0]) / np.ptp(data.session)
    drift = 8.0 * np.sin(5.0 * t) + 5.0 * np.sin(14.0 * t)
    if tare == "run":
        first = np.flatnonzero(np.diff(data.run, prepend=-1))
        drift = drift - drift[first][np.cumsum(np.diff(data.run, prepend=-1) != 0) - 1]
    axis = np.array([0.35, -1.0, 0.6])
    across, along = (
        np.stack(each)[data.setup]
        for each in (
            [s.tangents @ axis for s in data.setups],
            [s.unit_vector @ axis for s in data.setups],
        )
    )
    assert data.tangential is not None
    seen = data.tangential + across * drift[:, None]
    bench = make_bench(replace(data, force=data.force + along * drift, tangential=seen))
    variants = library(bench, ["force_drift"])
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 4e-6, 2e-5]))
    best, *others = sorted(score(engine, engine.levels, variants), key=lambda s: -s.log_evidence)
    assert best.variant.label == "winding path, as read at rest"
    # a zero that is off, all the time, says nothing of what drifts
    zero = np.array([30.0, 5.0, -20.0])
    ahead = np.stack([s.unit_vector @ zero for s in data.setups])[data.setup]
    aside = np.stack([s.tangents @ zero for s in data.setups])[data.setup]
    off = make_bench(
        replace(data, force=data.force + along * drift + ahead, tangential=seen + aside)
    )
    found = next(v for v in library(off, ["force_drift"]) if v.label == best.variant.label)
    assert found.info["along"] == pytest.approx(best.variant.info["along"], abs=1e-6)
    assert best.log_evidence > others[0].log_evidence + 20
    assert np.array(best.variant.info["along"]) == pytest.approx(axis * -1, abs=0.05) or np.array(
        best.variant.info["along"]
    ) == pytest.approx(axis, abs=0.05)
    law, scale = law_of(bench, best.variant)
    exact = np.stack([bench.columns[c] for c in best.variant.columns], axis=1)
    assert rows_of(bench, "force_drift", law) * scale == pytest.approx(exact, abs=1e-12)


def test_what_reads_nothing_at_rest_has_no_axis() -> None:
    data = arm_data()
    assert data.tangential is not None
    quiet = data.branch == 0
    still = replace(
        data,
        force=np.where(quiet, 0.0, data.force),
        tangential=np.where(quiet[:, None], 0.0, data.tangential),
    )
    for seen in (data, still):
        labels = [v.label for v in library(make_bench(seen), ["force_drift"])]
        assert not any(label.endswith("as read at rest") for label in labels)


def test_amplifiers_that_drift_each_on_its_own_have_no_axis_in_common() -> None:
    data = arm_data()
    t = (data.session - data.session[0]) / np.ptp(data.session)
    each = np.stack([8.0 * np.sin(w * t + w) for w in (5.0, 9.0, 14.0)], axis=1)
    across, along = (
        np.einsum("nk,n...k->n...", each, np.stack(vectors)[data.setup])
        for vectors in (
            [s.tangents for s in data.setups],
            [s.unit_vector for s in data.setups],
        )
    )
    assert data.tangential is not None
    seen = replace(data, force=data.force + along, tangential=data.tangential + across)
    labels = [v.label for v in library(make_bench(seen), ["force_drift"])]
    assert not any(label.endswith("as read at rest") for label in labels)


@pytest.mark.parametrize("times", [200.0, 1 / 200])
def test_a_rig_in_another_unit_is_told_by_its_factor(times: float) -> None:
    """Stiffness 200 times what is simulated, or a 200th of it: no factor ends at a bound."""
    step = np.tile(np.repeat(np.arange(9), 4), 3)
    u, run = 20.0 * step / SPRING / times, np.arange(len(step)) // 36
    noise = 1e-3 * float(u.max())
    read = u + np.random.default_rng(0).normal(0, noise, len(u))
    data = bench_data(
        20.0 * step,
        read,
        step=step,
        branch=np.where(step > 0, 1, 0),
        repetition=1 + run,
        run=run,
        imposed="force",
    )
    data = replace(data, instruments=replace(data.instruments, displacement=noise))
    (effect,) = explained(data).effects
    key, told = ("factor_x", times) if times > 1 else ("factor", 1 / times)
    factor = effect.parameters[key]
    assert factor.value == pytest.approx(told, rel=0.1)
    assert factor.low < told < factor.high


@pytest.mark.parametrize(
    ("times", "sd", "word"),
    [
        (1.38, 0.1, "joint_stiffness_error"),
        (0.7, 0.1, "joint_stiffness_error"),
        (1.1, 0.1, "none"),
        (0.9, 0.1, "none"),
        (5.0, 0.4, "joint_stiffness_error"),
        (1.6, 0.4, "none"),
    ],
)
def test_nothing_is_wrong_as_long_as_a_spring_is_about_as_stiff_as_stated(
    times: float, sd: float, word: str
) -> None:
    """38 % stiffer is 2.8 standard deviations of a tenth of the compliance and 3.8 of the
    stiffness."""
    step = np.tile(np.repeat(np.arange(9), 4), 3)
    u, run = 20.0 * step / SPRING / times, np.arange(len(step)) // 36
    read = u + np.random.default_rng(0).normal(0, 1e-3 * float(u.max()), len(u))
    data = bench_data(
        20.0 * step,
        read,
        step=step,
        branch=np.where(step > 0, 1, 0),
        repetition=1 + run,
        run=run,
        imposed="force",
    )
    meter = replace(data.instruments, displacement=1e-3 * float(u.max()))
    stated = replace(data, instruments=meter, compliance_relative_sd=np.array([sd]))
    assert explained(stated).verdict == word


@pytest.mark.parametrize(("hours", "pieces"), [(0.3, 32), (1.26, 50), (9.0, 64)])
def test_a_bias_current_turns_every_minute_and_a_half(hours: float, pieces: int) -> None:
    """Of a long session the path has more pieces, and never fewer than that of a room."""
    data = arm_data()
    longer = hours * 3600 / float(np.ptp(data.session))
    bench = make_bench(replace(data, session=data.session * longer))
    winding = [v for v in library(bench, ["force_drift"]) if v.label == "winding path"]
    assert [v.info["pieces"] for v in winding] == [pieces]
