"""What parameters mean, whatever shape was fitted, and how their intervals come about."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from identification.gap.answer.forms import describe
from identification.gap.answer.parameters import parameters
from identification.gap.answer.posterior import (
    Known,
    settled,
)
from identification.gap.effects import library
from identification.gap.effects.joint_creep import run_seconds
from identification.gap.effects.time_lag import closest_lag
from identification.gap.evidence.alike import level_covariance
from identification.gap.evidence.engine import HOLD_PART, ROW_PART, Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.laws.interval import NOMINAL, ComplianceChange, Parameter
from identification.gap.laws.lags import late
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from tests.unit.test_gap_evidence import small_bench, small_engine
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data

Array = np.ndarray


def known_of(
    engine: Engine,
    variants: list[Variant],
    chosen: Explanation,
    rivals: Iterable[Explanation] = (),
) -> list[Known]:
    """What is known of each effect."""
    return settled(engine, variants, chosen, rivals)[1]


def up_and_down() -> Bench:
    """Two runs of four steps up and three down, four samples each, 3 s to turn the screw."""
    level = np.array([0, 20, 40, 60, 80, 60, 40, 20.0])
    step = np.repeat(np.arange(8), 4)
    time = (7.0 * np.arange(8)[:, None] + np.arange(4.0)).ravel()
    force = np.tile(level[step], 2)
    return make_bench(
        bench_data(
            force,
            force * 1e-5,
            time=np.tile(time, 2),
            step=np.tile(step, 2).astype(np.int64),
            run=np.repeat([0, 1], 32),
            repetition=np.repeat([1, 2], 32),
            branch=np.tile(np.where(step == 0, 0, np.where(step > 4, 2, 1)), 2),
        )
    )


def of(bench: Bench, word: str, wanted: str) -> Variant:
    return next(v for v in library(bench, [word]) if wanted in v.label)


def sd(p: Parameter) -> float:
    return (p.high - p.low) / (2 * 1.959964)


def no_spread(w: Array) -> Array:
    return np.zeros((len(w), len(w)))


SAME = {  # parameter -> key of the term that a model file has for it
    ("joint_yield", "threshold"): "threshold",
    ("base_slip", "threshold"): "threshold",
    ("joint_backlash", "width"): "width",
    ("joint_creep", "retardation_time"): "retardation_time",
    ("base_compliance", "compliance_about_x"): "compliance",
    ("contact_seating", "force_scale"): "force_scale",
}


@pytest.mark.parametrize(("word", "name"), SAME)
def test_a_parameter_of_a_single_term_is_what_the_model_file_says(word: str, name: str) -> None:
    """Of what several terms share it is an equivalent (docs/gap.md)."""
    arm = word.startswith("base")
    bench, key = make_bench(arm_data()) if arm else up_and_down(), SAME[word, name]
    single = next(
        v
        for v in library(bench, [word])
        if v.info.get("knee", "sharp") == "sharp" and (not arm or "axis x" in v.label)
    )
    if "radius" in single.info:
        alone = {"radius": single.info["radius"][:1], "centre": single.info["radius"][0]}
        single = replace(single, columns=single.columns[:1], info={**single.info, **alone})
    w = np.zeros(len(single.columns))
    w[0] = 1e-3
    form = describe(bench, Part(single, 1.0), w, no_spread(w))
    term = form.law.terms[0]
    written = term.shape.get(key, form.values[0])
    assert key in term.shape or key == term.coefficient
    found = parameters(bench, Part(single, 1.0), w, no_spread(w), NOMINAL)[name]
    assert found.value * (1e-3 if found.unit == "mm" else 1.0) == pytest.approx(written, rel=1e-9)


def test_a_round_knee_has_the_threshold_of_the_sharp_one_with_equal_work() -> None:
    bench = up_and_down()
    knee = of(bench, "joint_yield", "round")
    radius = np.asarray(knee.info["radius"])
    w = np.zeros(len(knee.columns))
    w[: len(radius)] = np.linspace(0.2, 0.8, len(radius))
    found = parameters(bench, Part(knee, 1.0), w, no_spread(w))["threshold"]
    x = np.linspace(0, 80, 20001)
    path = np.maximum(x[:, None] - radius, 0.0) @ w[: len(radius)]
    sharp = path[-1] / (80 - found.value) * np.maximum(x - found.value, 0.0)
    assert sharp[-1] == pytest.approx(path[-1])
    assert np.trapezoid(sharp, x) == pytest.approx(np.trapezoid(path, x), rel=1e-4)


def test_a_radius_that_was_never_passed_says_nothing_of_slope_and_threshold() -> None:
    bench = up_and_down()
    knee = of(bench, "joint_yield", "sharp")
    top = float(np.abs(knee.info["load"]).max())
    info = {**knee.info, "radius": np.array([0.8 * top, 1.1 * top])}
    two = replace(knee, columns=knee.columns[:2], root=np.eye(2), info=info)
    found = parameters(bench, Part(two, 1.0), np.array([3.0, -50.0]), 1e-6 * np.eye(2))
    assert found["slope_beyond_over_elastic"].value == pytest.approx(3.0)
    assert found["threshold"].value == pytest.approx(0.8 * top)


def test_spread_of_a_threshold_is_that_of_its_draws_and_of_the_gain() -> None:
    bench = up_and_down()
    knee = of(bench, "joint_yield", "round")
    k, own = len(knee.columns), len(knee.info["radius"])
    rng = np.random.default_rng(0)
    w = np.where(np.arange(k) < own, 0.5, 0.0)
    root = 0.01 * rng.normal(size=(k, k))
    found = parameters(bench, Part(knee, 1.0), w, root @ root.T)["threshold"]
    top = 80 - np.asarray(knee.info["radius"])
    drawn = (w + rng.normal(size=(20000, k)) @ root.T)[:, :own]
    values = 80 - drawn @ top**2 / (drawn @ top)
    gain = bench.data.instruments.force_gain * found.value
    assert sd(found) == pytest.approx(np.hypot(values.std(), gain), rel=0.03)


def test_spread_of_a_slope_is_that_of_its_draws_with_the_threshold_that_goes_with_it() -> None:
    """Where the knee lies and how soft it is beyond follow from the same weights."""
    bench = up_and_down()
    knee = of(bench, "joint_yield", "round")
    k, radius = len(knee.columns), np.asarray(knee.info["radius"])
    rng = np.random.default_rng(0)
    w = np.where(np.arange(k) < len(radius), 0.5, 0.0)
    root = 0.01 * rng.normal(size=(k, k))
    softer = ComplianceChange({0: 0.2}, {0: 0.0}, {0: np.zeros(k)})
    found = parameters(bench, Part(knee, 1.0), w, root @ root.T, softer)
    top = 80 - radius
    drawn = (w + rng.normal(size=(20000, k)) @ root.T)[:, : len(radius)]
    slope = found["slope_beyond_over_elastic"]
    assert slope.value == pytest.approx(
        w[: len(radius)] @ top / (80 - found["threshold"].value) / 1.2
    )
    assert sd(slope) == pytest.approx(((drawn @ top) ** 2 / (drawn @ top**2) / 1.2).std(), rel=0.03)


def test_spread_of_a_slope_whose_threshold_is_held_is_that_of_its_path() -> None:
    """A negative weight would put the threshold where no radius is: it is held at the first one."""
    bench = up_and_down()
    knee = of(bench, "joint_yield", "sharp")
    info = {**knee.info, "radius": np.array([32.0, 40.0])}
    two = replace(knee, columns=knee.columns[:2], root=np.eye(2), info=info)
    w, cov = np.array([2.0, -1.0]), 1e-6 * np.eye(2)
    found = parameters(bench, Part(two, 1.0), w, cov)
    assert found["threshold"].value == 32.0
    path = np.array([48.0, 40.0]) / 48.0
    assert found["slope_beyond_over_elastic"].value == pytest.approx(path @ w)
    assert sd(found["slope_beyond_over_elastic"]) == pytest.approx((path @ cov @ path) ** 0.5)


@pytest.mark.parametrize(("shape", "grows"), [("bend", [0, 1, 1]), ("cubic", [3])])
def test_change_of_a_compliance_is_over_that_which_was_found(shape: str, grows: list[int]) -> None:
    """Not over the simulated one, which may be off; a line beside the bends is part of it."""
    bench = up_and_down()
    v = of(bench, "joint_nonlinear_stiffness", shape)
    w = np.linspace(0.3, 0.9, len(grows))
    found, line = np.append(0.2, w), v.info["kinds"][0] == "line"
    rng = np.random.default_rng(0)
    root = 0.02 * rng.normal(size=(len(found),) * 2)
    cov = root @ root.T
    softer = ComplianceChange({0: 0.2}, {0: cov[0, 0]}, {0: cov[0, 1:]})
    p = parameters(bench, Part(v, 1.0), w, cov[1:, 1:], softer)["change_of_compliance_over_range"]
    drawn = found + rng.normal(size=(20000, len(found))) @ root.T
    values = drawn[:, 1:] @ grows / (1 + drawn[:, 0] + line * drawn[:, 1])
    assert p.value == pytest.approx(w @ grows / (1.5 if line else 1.2))
    assert sd(p) == pytest.approx(values.std(), rel=0.03)


def test_creep_is_what_comes_late_in_the_end_and_in_a_run() -> None:
    bench = up_and_down()
    assert run_seconds(bench) == 52.0
    spectrum = of(bench, "joint_creep", "spectrum")
    times = np.asarray(spectrum.info["times_s"])
    w = np.linspace(0.02, 0.05, len(times))
    found = parameters(bench, Part(spectrum, 1.0), w, no_spread(w))
    assert found["creep_fraction"].value == pytest.approx(w.sum())
    assert found["creep_fraction_of_run"].value == pytest.approx(w @ (1 - np.exp(-52.0 / times)))
    assert found["run"].value == 52.0


def test_what_flows_counts_by_what_it_does_in_one_run() -> None:
    """A dashpot goes on under load, and does not come back without it (Burgers 1935)."""
    bench = make_bench(arm_data())
    rows, span = bench.rows, bench.load_history.session_span
    v = of(bench, "joint_creep", "joint 2 spectrum")
    times = np.asarray(v.info["times_s"])
    assert times[-1] == pytest.approx(10 * span)
    assert times[-2] < span / 3 + 1
    flows = bench.columns[v.columns[-1]][: rows.n]
    load = bench.lever[:, 1] * bench.compliance[1] * bench.true_torque[:, 1]
    upward = np.concatenate([[0.0], np.diff(rows.session) * 0.5 * (load[1:] + load[:-1])])
    upward[rows.starts] = 0.0
    mine = rows.run == 0  # unloaded within it: what has flown stays
    expected = np.cumsum(upward[mine]) / run_seconds(bench)
    np.testing.assert_allclose(flows[mine], expected, atol=0.12 * np.abs(expected).max())
    assert flows[mine][-1] > 0.9 * np.abs(flows[mine]).max()
    w = np.zeros(len(times))
    w[-1] = 0.3
    found = parameters(bench, Part(v, 1.0), w, no_spread(w))
    assert found["creep_fraction"].value == pytest.approx(0.3)
    assert found["creep_fraction_of_run"].value == pytest.approx(0.3, rel=0.02)


def test_creep_is_counted_against_the_spring_as_it_is() -> None:
    """A spring 25 % softer than simulated, known to 10 %: against draws; and the load came to its
    level at any time of its way there, of 3 s."""
    bench = up_and_down()
    single = of(bench, "joint_creep", "T ")
    rng = np.random.default_rng(1)
    full = np.array([[4e-4, 1e-4, 5e-4], [1e-4, 3e-4, -2e-4], [5e-4, -2e-4, 1e-2]])
    w, joint = np.array([0.15, 0.1]), int(single.info["joint"])
    softer = ComplianceChange({joint: 0.25}, {joint: full[2, 2]}, {joint: full[2, :2]})
    found = parameters(bench, Part(single, 1.0), w, full[:2, :2], softer)["creep_fraction_of_run"]
    after = 1 - np.exp(-52.0 / np.asarray(single.info["times_s"]))
    drawn = np.array([*w, 0.25]) + rng.normal(size=(40000, 3)) @ np.linalg.cholesky(full).T
    values = drawn[:, :2] @ after / (1 + drawn[:, 2])
    assert found.value == pytest.approx(w @ after / 1.25)
    early = np.minimum(3 / 12**0.5 / np.asarray(single.info["times_s"]), 0.5)
    came = w * early * (1 + w.sum()) @ after / 1.25
    assert came > 0.01
    assert sd(found) == pytest.approx(np.hypot(values.std(), came), rel=0.05)


@pytest.mark.parametrize("true", [0.9, 1.3, 2.2])
def test_a_lag_is_read_by_what_it_does(true: float) -> None:
    bench = up_and_down()
    column = of(bench, "time_lag", "displacement delay 1.6 s")
    place = bench.add(late(bench, "displacement", "delay", true))
    column = replace(column, columns=(place,))
    found = parameters(bench, Part(column, 1.0), np.ones(1), np.zeros((1, 1)))["lag"]
    assert found.value == pytest.approx(true, rel=0.02)
    assert found.low < true < found.high
    # the load moves for 3 s, begun within the last half second: that much of what is seen is open
    assert sd(found) > 0.9 * 0.5 * 0.5 / 3 * (true - 0.5)


def test_a_bench_whose_lag_was_read_is_let_go() -> None:
    bench = up_and_down()
    closest_lag(bench, "displacement", "delay", np.full(bench.rows.n, 1e-6))
    other = replace(bench, moves=2 * bench.line)
    does = late(other, "displacement", "delay", 0.9)[: other.rows.n]
    lag, _ = closest_lag(other, "displacement", "delay", does)
    assert lag == pytest.approx(0.9, rel=0.1)  # of the copy's own path
    kept = weakref.ref(bench)
    del bench, other
    gc.collect()
    assert kept() is None


def test_a_lag_in_proportion_to_what_it_does() -> None:
    """The first sample comes half a second after the load: a delay of 0.9 s does little more than a
    third of what one of 1.6 s does."""
    bench = up_and_down()
    column = of(bench, "time_lag", "displacement delay 1.6 s")
    other, own = (late(bench, "displacement", "delay", t)[: bench.rows.n] for t in (0.9, 1.6))
    w = np.array([float(other @ own / (own @ own))])
    assert w[0] * 1.6 < 0.6
    found = parameters(bench, Part(column, 1.0), w, np.zeros((1, 1)))["lag"]
    assert found.value == pytest.approx(0.9, rel=0.1)


def test_what_neither_a_delay_nor_a_filter_does_is_known_less_well() -> None:
    bench = up_and_down()
    both = of(bench, "time_lag", "displacement window 2 s")
    delay, filtered = (
        parameters(bench, Part(both, 1.0), np.array(w), np.zeros((2, 2)))["lag"]
        for w in ([1.0, 0.0], [0.0, 1.0])
    )
    mixed = parameters(bench, Part(both, 1.0), np.array([0.5, 0.5]), np.zeros((2, 2)))["lag"]
    assert delay.value == pytest.approx(2.0, rel=0.02)
    assert filtered.value == pytest.approx(2.0, rel=0.02)

    def beyond(p: Parameter) -> float:
        """What is not owed to when the load began to move."""
        return float(sd(p) ** 2 - (0.5 * 0.5 / 3 * (p.value - 0.5)) ** 2)

    assert beyond(mixed) > 4 * max(beyond(delay), beyond(filtered))


def test_depth_of_a_seat_is_that_at_the_largest_load() -> None:
    bench = up_and_down()
    seat = of(bench, "contact_seating", "hyperbolic")
    found = parameters(bench, Part(seat, 1.0), np.array([1e-5]), np.zeros((1, 1)))["depth"]
    assert found.value == pytest.approx(1e-2 * 80 / (80 + seat.info["force_N"]))


# --- covariance that knows the mistakes of a law ---


def explained(engine: Engine, eta: float) -> Explanation:
    v = Variant("joint_nonlinear_stiffness", "", (0,), (1.0,), np.eye(1))
    return Explanation((Part(v, 1.0),), 0.0, eta, (0.0,), 0.0)


def test_covariance_under_alike_mistakes_is_the_scatter_of_the_estimate() -> None:
    """`b = H^-1 X' V^-1 y` under noise V and mistakes K that repeat, in full matrices; V as the fit
    takes it. The plain covariance falls short of it."""
    bench = small_bench()
    engine, eta = small_engine(bench, (0.0, 6e-6)), 6e-6
    plain = fit(engine, explained(engine, eta))
    alike = fit(engine, explained(engine, eta), alike=True)
    V = np.diag(bench.sigma**2 + (ROW_PART * eta) ** 2)
    same = np.equal.outer(bench.rows.hold, bench.rows.hold)
    V += same * (np.outer(bench.noise.hold, bench.noise.hold) + (HOLD_PART * eta) ** 2)
    levels = level_covariance(bench)[np.ix_(bench.rows.level, bench.rows.level)]
    K = eta**2 * (levels + 0.6**2 * _hats(bench) + _alike(bench, engine, plain.coefficients))
    X = np.column_stack([engine.base.columns, engine.bench.columns[0]])
    prior = np.diag(1 / np.append(engine.base.sd, 1.0) ** 2)
    weighed = np.linalg.solve(V, X)
    H = np.linalg.inv(X.T @ weighed + prior)
    scatter = H @ (weighed.T @ (V + K) @ weighed + prior) @ H
    np.testing.assert_allclose(plain.covariance[0, 0], H[-1, -1], rtol=1e-4)
    np.testing.assert_allclose(alike.covariance[0, 0], scatter[-1, -1], rtol=1e-4)
    assert np.sqrt(plain.covariance[0, 0]) < 0.8 * np.sqrt(scatter[-1, -1])


def _hats(bench: Bench) -> Array:
    """Covariance of four hat functions of the load with independent unit heights."""
    x = bench.load
    hats = []
    for run in np.unique(bench.rows.run):
        mine = bench.rows.run == run
        at = (x - x[mine].min()) / np.ptp(x[mine]) * 3
        hats.append(np.where(mine[:, None], np.maximum(0, 1 - np.abs(at[:, None] - range(4))), 0))
    all_hats = np.column_stack(hats)
    return np.asarray(all_hats @ all_hats.T)


def _alike(bench: Bench, engine: Engine, w: Array) -> Array:
    """Covariance of mistakes by place in the hold: an even one, and a share of the law's own."""
    rows, n = bench.rows, bench.rows.n
    first = np.array([np.flatnonzero(rows.hold == h)[0] for h in rows.hold])
    place = np.minimum(np.arange(n) - first, 3)
    before = np.maximum(first - 1, 0)
    rises = np.abs(bench.load[first]) >= np.abs(bench.load[before])
    does = bench.columns[0][:n] * w[0]
    does = does - np.average(does, weights=rows.weight)
    does /= np.sqrt(np.average(does**2, weights=rows.weight))
    key = place * 2 + rises
    return np.asarray(np.equal.outer(key, key) * (1 + np.outer(does, does)))


def test_without_imperfection_nothing_is_added() -> None:
    engine = small_engine(small_bench())
    one, other = (fit(engine, explained(engine, 0.0), alike=a) for a in (False, True))
    np.testing.assert_array_equal(one.covariance, other.covariance)


# --- mixtures ---


def test_friction_with_a_spring_of_its_own_is_counted_against_that_spring() -> None:
    """Of draws: share through friction over the spring as it is with the line."""
    load = 80 * np.sin(np.arange(300) / 15)
    bench = make_bench(bench_data(load, load * 1e-5, step=np.full(300, -1), branch=np.full(300, 3)))
    rubs = of(bench, "joint_hysteresis", "r 0.2, other springs")
    k, joint = len(rubs.columns) - 1, int(rubs.info["joint"])
    rng = np.random.default_rng(2)
    root = 0.01 * rng.normal(size=(k + 2, k + 2))
    full = root @ root.T
    w = np.array([*[0.3] * k, 0.5])
    softer = ComplianceChange({joint: 0.1}, {joint: full[-1, -1]}, {joint: full[-1, :-1]})
    found = parameters(bench, Part(rubs, 1.0), w, full[:-1, :-1], softer)
    drawn = np.append(w, 0.1) + rng.normal(size=(40000, k + 2)) @ root.T
    slips = np.asarray(rubs.info["radius"]) < np.ptp(np.append(bench.torque[:, joint], 0.0))
    share = drawn[:, :k] @ slips / (1 + drawn[:, k] + drawn[:, k + 1])
    through = found["share_through_friction"]
    assert (through.value, sd(through)) == pytest.approx((share.mean(), share.std()), rel=0.03)


@pytest.mark.parametrize("label", ["Dahl{} 0.08", "Bouc-Wen{} 0.2", "spectrum{}"])
def test_friction_means_the_same_in_both_conventions(label: str) -> None:
    """One curve: 0.3 of the spring rubs; or a spring that is 0.3 stiffer, and 0.3 slips on it."""
    bench, found = make_bench(arm_data()), []
    for on_top in ("", " that slips"):
        rubs = of(bench, "joint_hysteresis", label.format(on_top))
        joint, k = int(rubs.info["joint"]), len(rubs.columns)
        w = np.zeros(k)
        w[0] = 0.3
        s = -0.3 if on_top else 0.0
        softer = ComplianceChange({joint: s}, {joint: 0.0}, {joint: np.zeros(k)})
        found.append(parameters(bench, Part(rubs, 1.0), w, np.zeros((k, k)), softer))
    held, slips = found
    for name in ("friction", "share_through_friction"):
        assert held[name].value == pytest.approx(slips[name].value, rel=1e-9), name
        assert held[name].value > 0
    assert held["share_through_friction"].value == pytest.approx(0.3, rel=0.02)


def test_friction_is_over_the_spring_that_was_found() -> None:
    """Half the compliance that META states, and what rubs has 0.3 of META's: twice the friction."""
    bench = make_bench(arm_data())
    rubs = of(bench, "joint_hysteresis", "joint 1 r 0.2")
    joint, w = int(rubs.info["joint"]), np.full(len(rubs.columns), 0.3)
    softer = ComplianceChange({joint: -0.5}, {joint: 0.0}, {joint: np.zeros(len(w))})
    as_stated, stiffer = (
        parameters(bench, Part(rubs, 1.0), w, no_spread(w), s) for s in (NOMINAL, softer)
    )
    for name in ("friction", "share_through_friction"):
        assert stiffer[name].value == pytest.approx(2 * as_stated[name].value)


@pytest.mark.parametrize(("nearly", "counts"), [(0.7, 1.0), (0.9, 0.5), (0.999, 0.0)])
def test_strengths_near_the_largest_load_count_the_less(nearly: float, counts: float) -> None:
    load = 80 * np.sin(np.arange(300) / 15)
    bench = make_bench(bench_data(load, load * 1e-5, step=np.full(300, -1), branch=np.full(300, 3)))
    rubs = of(bench, "joint_hysteresis", "r 0.2")
    radius = np.array([nearly, 10.0]) * np.abs(bench.torque).max()
    one = replace(rubs, info={**rubs.info, "radius": radius})
    read = parameters(bench, Part(one, 1.0), np.array([0.2, 0.0]), np.zeros((2, 2)))
    spring = 1 - 0.2 * (1 - counts)  # what does not slip is part of it
    expected = 0.2 * radius[0] * counts / spring
    assert read["friction"].value == pytest.approx(expected, abs=0.01 * radius[0])


def test_friction_is_not_below_zero() -> None:
    """However little the data tell of it: an interval that reaches below ends there."""
    load = 80 * np.sin(np.arange(300) / 15)
    bench = make_bench(bench_data(load, load * 1e-5, step=np.full(300, -1), branch=np.full(300, 3)))
    rubs = of(bench, "joint_hysteresis", "r 0.2")
    k = len(rubs.columns)
    softer = ComplianceChange({}, {}, {})
    for way, below in ((-0.1, True), (0.9, False)):
        read = parameters(bench, Part(rubs, 1.0), np.full(k, way), 0.01 * np.eye(k), softer)
        friction = read["friction"].possible(0.0)
        assert (friction.value == 0.0) is below
        assert (friction.low == 0.0) is below
        assert 0 <= friction.ci90[0] <= friction.ci90[1] <= friction.high


def test_a_threshold_about_a_lying_axis_is_as_uncertain_as_its_depth() -> None:
    """Yaw knows no depth."""
    bench = make_bench(arm_data())
    spread = {}
    for axis, depth in (("x", 0.7), ("z", 0.0)):
        v = next(
            v
            for v in library(bench, ["base_slip"])
            if (v.info["axis"], v.info["depth_m"]) == (axis, depth) and v.info["knee"] == "sharp"
        )
        k = len(v.columns)
        found = parameters(bench, Part(v, 1.0), np.ones(k), 1e-9 * np.eye(k), NOMINAL)["threshold"]
        spread[axis] = sd(found) / found.value
    lever = 0.175 / 12**0.5
    assert spread["x"] > spread["z"] + 0.02
    assert spread["x"] == pytest.approx(np.hypot(spread["z"], lever / 1.2), rel=0.2)


@pytest.mark.parametrize(
    ("imposed", "possible"), [("force", (-1.0, np.inf)), ("displacement", (-np.inf, 1.0))]
)
def test_no_spring_loses_more_than_it_has(
    imposed: Literal["force", "displacement"], possible: tuple[float, float]
) -> None:
    """Compliance where the force is driven, stiffness where the displacement is."""
    load = 80 * np.sin(np.arange(300) / 15)
    data = bench_data(load, load * 1e-5, step=np.full(300, -1), branch=np.full(300, 3))
    bench = make_bench(replace(data, imposed=imposed))
    curve = of(bench, "joint_nonlinear_stiffness", "cubic")
    w = np.full(len(curve.columns), -3.0)
    (p,) = parameters(bench, Part(curve, 1.0), w, 0.01 * np.eye(len(w)), NOMINAL).values()
    least, most = possible
    found = p.possible(-np.inf)
    assert least <= found.low <= found.value <= found.high <= most
    assert found.value in possible
