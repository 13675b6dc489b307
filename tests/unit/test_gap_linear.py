"""Springs, links and mountings: what they may be, and which of their numbers stand together."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from identification.gap.answer.locate import _joints
from identification.gap.data import Instruments
from identification.gap.effects import library
from identification.gap.effects.base_compliance import moments
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, Sizes, _beyond_springs
from identification.gap.evidence.signs import Limits, log_odds
from identification.gap.explanations.penalties import below_noise, unbent_curves, within_stated
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.model.variants import Variant
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(arm_data(directions="xyz"))


def of(bench: Bench, word: str) -> tuple[Bench, dict[str, Variant]]:
    fresh = replace(bench, columns=Pool())
    return fresh, {v.label: v for v in library(fresh, (word,))}


def charged(v: Variant, w: list[float], sd: float = 0.01) -> float:
    """nats that coefficients known to sd cost against the limits."""
    limits = Limits.of([v])
    assert limits is not None
    rows = limits.rows
    before = np.linalg.norm(rows, axis=2)
    return float(log_odds(limits, np.zeros(1, int), before, rows @ np.array(w), sd * rows)[0])


@pytest.mark.parametrize(
    ("word", "label", "good", "bad"),
    [
        ("base_compliance", "axes 0.3 m below", [1.0, 0.2, 0.5], [1.0, -0.2, 0.5]),
        ("base_compliance", "turned axes 0.3 m below", [1, 0.5, 0.2, 0.7], [1, 0.5, -0.2, 0.7]),
        ("base_compliance", "turned axes 0.3 m below", [1, 0.5, 0.2, 0.7], [1, 0.5, 0.2, 0.9]),
        ("base_compliance", "turned axes 0.3 m below", [1, 0.5, 0.2, -0.7], [1, 0.5, 0.2, -0.9]),
        ("link_flexibility", "segment 1", [1, 1, 1, 0.3], [1, 1, 1, -0.3]),
        ("link_flexibility", "segment 1", [0.2, 1, 0.2, 0.3], [-0.2, 1, 0.2, 0.3]),
        (
            "link_flexibility",
            "both arms",
            [1, 1, 1, 0.3, 0.5, 0.5, 0.5, 0.1],
            [1, 1, 1, 0.3, 0.5, -0.5, 0.5, 0.1],
        ),
    ],
)
def test_what_bends_gives_way_under_load_in_every_part(
    bench: Bench, word: str, label: str, good: list[float], bad: list[float]
) -> None:
    v = of(bench, word)[1][label]
    assert charged(v, good) > 0.0
    assert charged(v, bad) < -25.0


def test_axes_are_turned_where_both_that_lie_are_seen() -> None:
    """Pushed all but along y, far out: about y next to nothing turns the stand."""
    data = arm_data(directions="y")
    n = np.array([0.0012, 1.0, 0.0]) / np.hypot(0.0012, 1.0)
    setups = tuple(
        replace(s, unit_vector=n, moment=np.array([-0.7, 0.0008, 0.3])) for s in data.setups
    )
    bench = make_bench(replace(data, setups=setups))
    m = moments(bench, 0.0)[0]
    assert abs(m[1]) < 1e-3 < abs(2 * m[0] * m[1])
    _, variants = of(bench, "base_compliance")
    assert variants["axes 0 m below"].info["axes"] == [0, 2]
    assert "turned axes 0 m below" not in variants
    assert all(set(v.info["axes"]) >= {0, 1} for v in variants.values() if v.info["turned"])


def test_a_stand_that_tilts_about_an_oblique_edge_has_turned_axes(bench: Bench) -> None:
    fresh, variants = of(bench, "base_compliance")
    edge = np.array([np.cos(0.6), np.sin(0.6), 0.0])
    gives = fresh.outside_column((moments(fresh, 0.3) @ edge) ** 2 * fresh.load)
    pool = np.column_stack(fresh.columns)
    left = {}
    for label in ("axes 0.3 m below", "turned axes 0.3 m below"):
        columns = pool[:, list(variants[label].columns)]
        w = np.linalg.lstsq(columns / np.abs(columns).max(), gives, rcond=None)[0]
        left[label] = np.linalg.norm(gives - columns @ w / np.abs(columns).max())
    assert left["turned axes 0.3 m below"] < 1e-9 * np.linalg.norm(gives)
    assert left["axes 0.3 m below"] > 0.02 * np.linalg.norm(gives)


def test_any_two_springs_may_be_wrong_together(bench: Bench) -> None:
    fresh, variants = of(bench, "joint_stiffness_error")
    pairs = {tuple(v.info["joints"]) for v in variants.values() if len(v.info["joints"]) == 2}
    assert pairs == set(combinations(fresh.moving_joints(), 2))


def test_of_what_the_springs_hide_a_little_counts(bench: Bench) -> None:
    """Wrong springs are all that springs can give; beside another effect they are not nothing."""
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))
    spring = engine.base.index("spring")[:1]
    column = engine.base.columns[: bench.rows.n, spring] * engine.base.sd[spring]
    moved = 0.5 * engine.bench.rows.about_means(column)[:, 0]  # half a standard deviation
    size = np.sqrt(bench.rows.weight @ moved**2 / bench.rows.weight.sum())
    assert _beyond_springs(engine, moved) == pytest.approx(0.03 * size)
    assert _beyond_springs(engine, 100 * moved) > 0.9 * 100 * size


def test_a_curve_that_hardly_bends_is_a_wrong_spring(bench: Bench) -> None:
    fresh, variants = of(bench, "joint_nonlinear_stiffness")
    engine = Engine(fresh, base_columns(fresh), fresh.observed, np.array([0.0, 3e-6]))
    curve = next(v for name, v in variants.items() if "curve" in name)
    one = (Part(curve, 1.0),)

    def charge(gap: float) -> float:
        return unbent_curves(engine, one, Sizes(np.array([gap]), np.array([1e-4]), 0.0))

    assert charge(1e-5) == 0.0
    assert charge(1e-6) == pytest.approx(60 * np.log(4))
    spring = (Part(of(bench, "joint_stiffness_error")[1]["joint 1"], 1.0),)
    assert unbent_curves(engine, spring, Sizes(np.zeros(1), np.array([1e-4]), 0.0)) == 0.0


@pytest.mark.parametrize("word", ["force_scale", "displacement_scale"])
def test_a_gain_within_what_is_stated_is_no_effect(bench: Bench, word: str) -> None:
    fresh, variants = of(bench, word)
    engine = Engine(fresh, base_columns(fresh), fresh.observed, np.array([0.0, 3e-6]))
    gain, meter = variants["gain"], fresh.data.instruments
    sd = meter.force_gain if word == "force_scale" else meter.displacement_gain
    line = engine.bench.rows.about_means(engine.columns(gain.columns)[: fresh.rows.n])[:, 0]
    one = np.sqrt(fresh.rows.weight @ line**2 / fresh.rows.weight.sum())

    def charge(off: float) -> float:
        sizes = Sizes(np.zeros(1), np.array([off * one]), 0.0)
        return within_stated(engine, (Part(gain, 1.0),), sizes)

    assert charge(1.5 * sd) == pytest.approx(60 * np.log(2))
    assert charge(3.1 * sd) == 0.0


def test_a_spring_within_what_is_stated_is_none(bench: Bench) -> None:
    fresh, springs = of(bench, "joint_stiffness_error")
    spring = next(v for v in springs.values() if "joint" in v.info)
    base, target = base_columns(fresh), fresh.observed - prediction(fresh)
    engine = Engine(fresh, base, target, np.array([0.0, 1e-6]))
    sd = float(fresh.data.compliance_relative_sd[spring.info["joint"]])
    column = engine.columns(spring.columns)[: fresh.rows.n]
    weight = fresh.rows.weight
    one = float(np.sqrt(weight @ engine.bench.rows.about_means(column)[:, 0] ** 2 / weight.sum()))

    def charge(off: float) -> float:
        sizes = Sizes(np.zeros(1), np.array([off * one]), 0.0)
        return within_stated(engine, (Part(spring, 1.0),), sizes)

    assert charge(0.75 * sd) == pytest.approx(60 * np.log(2))
    assert charge(1.6 * sd) == 0.0


def test_at_rest_no_mechanism_far_below_the_noise_is_named(bench: Bench) -> None:
    """Beside whatever else; what springs may hide or the force at zero load shows is none, but for
    what bends of a gain."""
    fresh, found = of(bench, "joint_hysteresis")[0], {}
    for word in ("joint_hysteresis", "link_flexibility", "force_drift", "displacement_scale"):
        found[word] = Part(library(fresh, (word,))[0], 1.0)
    gains = library(fresh, ("displacement_scale",))
    for label in ("gain that bends", "gain that changes at 0.45"):
        found[label] = Part(next(v for v in gains if v.label == label), 1.0)
    base, target = base_columns(fresh), fresh.observed - prediction(fresh)
    engine = Engine(fresh, base, target, np.array([0.0, 1e-6]))
    noise = fresh.noise.stated

    def charge(words: list[str], sizes: list[float]) -> float:
        gap = np.array(sizes) * noise
        return below_noise(engine, tuple(found[w] for w in words), Sizes(gap, 1e3 * gap, 0.0))

    for what in ("joint_hysteresis", "gain that bends", "gain that changes at 0.45"):
        assert charge([what], [0.25]) == pytest.approx(60 * np.log(2))
        assert charge([what], [0.55]) == 0.0
    assert charge(["displacement_scale"], [0.1]) == 0.0
    assert charge(["link_flexibility", "joint_hysteresis"], [9.0, 0.1]) > 40
    assert charge(["link_flexibility", "force_drift"], [0.01, 0.01]) == 0.0


def test_of_many_wrong_springs_those_that_show_are_where_the_gap_lies(bench: Bench) -> None:
    fresh, variants = of(bench, "joint_stiffness_error")
    target = fresh.observed - prediction(fresh)
    engine = Engine(fresh, base_columns(fresh), target, np.array([0.0, 3e-6]))
    v = variants["all joints"]
    size = np.linalg.norm(fresh.rows.about_means(engine.responses(v.columns)), axis=0)
    w = np.array([1.0, 0.3, 0.1, 0.3, 0.0])[: len(size)] / size
    sd = np.array([0.1, 0.1, 0.01, 0.2, 1.0])[: len(size)] / size
    fit = SimpleNamespace(parts=(Part(v, 1.0),), of=lambda i: (w, np.diag(sd**2)))
    # the third is clear but small, the fourth may be none
    assert _joints(engine, "joint_stiffness_error", fit, [1.0]) == tuple(
        j + 1 for j in v.info["joints"][:2]
    )


def test_the_gap_lies_in_no_joint_that_does_next_to_nothing(bench: Bench) -> None:
    fresh, _ = of(bench, "joint_creep")
    each = [v for v in library(fresh, ("joint_creep",)) if "joint" in v.info]
    first, other = each[0], next(v for v in each if v.info["joint"] != each[0].info["joint"])
    fit = SimpleNamespace(parts=(Part(first, 1.0), Part(other, 1.0)))
    engine = SimpleNamespace(bench=fresh)
    for size, joints in ((0.3, (first, other)), (0.05, (first,))):
        assert _joints(engine, "joint_creep", fit, [1.0, size]) == tuple(
            v.info["joint"] + 1 for v in joints
        )


@pytest.mark.slow
def test_gains_of_a_bench_may_be_far_off_where_little_is_stated_of_them() -> None:
    """An excitation that was set wrong: the spring is known to a hundredth."""
    step = np.tile(np.concatenate([np.arange(9), np.arange(7, 0, -1)]), 3)
    rng, run = np.random.default_rng(3), np.repeat([0, 1, 2], 16)
    load = 20.0 * step
    for force_gain, verdict in ((0.15, "force_scale"), (0.001, "joint_stiffness_error")):
        data = bench_data(
            0.55 * load + rng.normal(0, 0.1, 48),
            1e-5 * load + rng.normal(0, 1e-6, 48),
            step=step,
            run=run,
            repetition=run + 1,
            imposed="force",
            instruments=Instruments(0.1, 1e-6, force_gain, 0.002),
            compliance_relative_sd=np.array([0.01]),
        )
        assert explained(data).verdict == verdict


def test_every_component_of_the_force_has_a_gain_of_its_own() -> None:
    """Of a push askew to them: what a sensor reads too much is less push along the direction, and a
    force across it that is none. Of pushes along the axes one gain is for all."""
    bench = make_bench(arm_data(directions="xyz"))
    names = base_columns(bench).names
    assert [n for n in names if "gain force" in n] == ["gain force"]
    turned, tangents = np.array([0.6, 0.8, 0.0]), np.array([[-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    askew = tuple(replace(s, unit_vector=turned, tangents=tangents) for s in bench.data.setups)
    n = len(bench.data.force)
    there = make_bench(replace(bench.data, setups=askew, tangential=np.zeros((n, 2))))
    base, rows = base_columns(there), there.rows.n
    whole = there.force_column(-there.load)[:rows]
    held = there.rows.hold_means(there.load[:, None])[:, 0]
    for axis, share, across in (("x", 0.36, -0.48), ("y", 0.64, 0.48)):
        column = base.columns[:, base.names.index(f"gain force {axis}")]
        np.testing.assert_allclose(column[:rows], share * whole, atol=1e-12)
        sides = column[there.layout.tangential].reshape(2, -1)
        np.testing.assert_allclose(sides, [across * held, 0.0 * held], atol=1e-9)
