"""Loops of a load from one side: what rubs, what flowed once, and what is told of neither."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData, Instruments
from identification.gap.effects import library
from identification.gap.explanations.priors import prior_of
from identification.gap.laws.bauschinger import BACK_FROM
from identification.gap.laws.friction_law import parameters
from identification.gap.laws.interval import Coefficients, ComplianceChange
from identification.gap.model.bench import make_bench
from identification.gap.model.history import play
from identification.gap.model.path import Path
from identification.gap.recording.loops import lost, work_used
from tests.explained import explained
from tests.unit.test_gap_closer import assert_lawful
from tests.unit.test_gap_model import survive
from tests.unit.test_gap_running import SPRING, running

METER = Instruments(0.1, 1e-6, 0.005, 0.003)
STROKE = 1e-3


def strokes(cycles: int = 3, growing: bool = False, n: int = 120) -> Array:
    """m: to and fro from zero, further each time where it grows."""
    ends = [STROKE * (k + 1) / cycles if growing else STROKE for k in range(cycles)]
    legs = [x for end in ends for x in (np.linspace(0, end, n), np.linspace(end, 0, n))]
    return np.concatenate(legs)


def flowed(u: Array, knee: float = 4e-4) -> tuple[Array, Array]:
    """Displacement m and force N of metal that is let go until no force is left."""
    plastic = np.maximum.accumulate(np.maximum(u - knee, 0.0))
    force = SPRING * (u - plastic)
    kept = force >= 0
    return u[kept], force[kept]


def rubbed(u: Array, radius: float = 20.0) -> Array:
    """N: a spring with friction beside it."""
    state = play((SPRING * u)[:, None], np.array([radius]), u == -1.0, u == -1.0)[:, 0]
    return np.asarray(SPRING * u + 0.8 * (SPRING * u - state))


def recording(u: Array, force: Array) -> GapData:
    noise = np.random.default_rng(4).normal(0, METER.force, len(u))
    return running(force + noise, u, imposed="displacement", instruments=METER)


def test_what_a_loop_encloses_is_a_share_of_its_box() -> None:
    """A parallelogram: 40 N high beside a slope that goes up by 100 N."""
    u = strokes(2)
    up = np.diff(u, prepend=-1.0) >= 0
    first, again = lost(u, SPRING * u + np.where(up, 40.0, 0.0), imposed=True)
    assert first == pytest.approx(40 / 140, abs=0.01)
    assert again == pytest.approx(40 / 140, abs=0.01)


def lifted(u: Array, by: float) -> Array:
    """N: a spring, and as much against the way at any rate."""
    return np.asarray(SPRING * u + np.where(np.diff(u, prepend=-1.0) >= 0, by, -by))


def test_friction_uses_up_work() -> None:
    """A parallelogram 12 N high along a slope over 100 N, there and back."""
    u = strokes(3)
    for by in (6.0, -6.0):
        used = work_used(u, lifted(u, by), imposed=True)
        np.testing.assert_allclose(used, 2 * by / (100 + 2 * abs(by)), rtol=0.15)


@pytest.mark.parametrize(("by", "verdict"), [(6.0, "joint_hysteresis"), (-6.0, "unknown")])
def test_no_passive_rig_gives_out_work(by: float, verdict: str) -> None:
    u = to_and_fro(6)
    data = recording(u, lifted(u, by))
    assert (make_bench(data).load_history.gives_out > 0) is (by < 0)
    found = explained(data)
    assert found.verdict == verdict
    assert any("the other way round" in note for note in found.notes) is (by < 0)


def test_no_loop_is_made_of_a_pull_or_of_one_cycle() -> None:
    u = strokes(1)
    assert np.isnan(lost(u[:120], SPRING * u[:120], imposed=True)).all()
    first, again = lost(u, SPRING * u, imposed=True)
    assert first == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(again)


@pytest.mark.parametrize("knee", [1e-4, 4e-4])
def test_metal_that_flows_on_comes_back_as_it_went(knee: float) -> None:
    u, force = flowed(strokes(4, growing=True), knee)
    bench = make_bench(recording(u, force))
    first, again = bench.load_history.lost_in_loops
    assert first > 0.2
    assert again < 0.04
    assert bench.load_history.comes_back_as_it_went
    assert not bench.load_history.rubs


def test_friction_rubs_every_time() -> None:
    u = strokes(4)
    bench = make_bench(recording(u, rubbed(u) + 25.0))
    assert bench.load_history.rubs
    assert not bench.load_history.comes_back_as_it_went


@pytest.mark.parametrize("what", ["both ways", "two runs", "a spring", "seats", "flows and rubs"])
def test_nothing_is_said_of_other_loads(what: str) -> None:
    u = strokes(4)
    data = recording(u, rubbed(u) + 25.0)
    if what == "both ways":  # metal flows back there
        data = recording(u, rubbed(u) - 40.0)
    elif what == "two runs":
        half = (np.arange(len(u)) >= len(u) // 2).astype(np.int64)
        data = running(
            data.force, u, imposed="displacement", instruments=METER, run=half, repetition=half + 1
        )
    elif what == "seats":  # by so little that anything may
        data = running(
            SPRING * u + 3.0 * (np.arange(len(u)) < 120),
            u,
            imposed="displacement",
            instruments=METER,
        )
    elif what == "flows and rubs":
        u, force = flowed(strokes(4, growing=True))
        data = recording(u, force + 6.0 * (np.diff(u, prepend=-1.0) >= 0))
    else:
        data = recording(u, SPRING * u)
    bench = make_bench(data)
    assert not bench.load_history.rubs
    assert not bench.load_history.comes_back_as_it_went


def test_loops_count_for_friction_and_against_it() -> None:
    u = strokes(4)
    rubs = make_bench(recording(u, rubbed(u) + 25.0))
    flows = make_bench(recording(*flowed(strokes(4, growing=True))))

    def prior(bench: object, *words: str) -> float:
        return prior_of(frozenset(words), bench)  # type: ignore[arg-type]

    assert prior(rubs, "joint_yield") < prior(flows, "joint_yield") - 10.0
    assert prior(flows, "joint_hysteresis") < prior(rubs, "joint_hysteresis") - 10.0
    both = ("joint_yield", "joint_hysteresis")
    assert prior(rubs, *both) > prior(flows, *both) + 10.0
    assert prior(rubs, "joint_creep") == prior(flows, "joint_creep")


def test_what_never_yielded_flows_not_back() -> None:
    """Small cycles before larger ones: a threshold that only the larger pass explains no loop of
    the small ones."""
    turn = np.sin(np.linspace(0, 4 * np.pi, 400, endpoint=False))
    force = np.concatenate([30 * turn, 60 * turn, 100 * turn])
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    found = [v for v in library(bench, ["joint_yield"]) if v.label.endswith("flows back")]
    assert {v.info["back_from"] for v in found} == set(BACK_FROM)
    for v in found:
        radius, top = v.info["radius"], v.info["top"]
        threshold = v.info["back_from"] * top
        assert threshold <= max(radius.min(), BACK_FROM[0] * top) + 1e-9
        own = [bench.columns[c] for c in v.columns[len(radius) :]]
        size = np.abs(np.column_stack(own)).max(axis=1)
        before = np.cumsum(np.abs(bench.load) > threshold) == 0
        assert size[: bench.rows.n][before].max() == 0.0 < size.max()


def metal(strain: Array) -> Array:
    """(n,) MPa of a structural steel: two backstresses, a yield surface that shrinks and grows
    (Chaboche 1986; constants of the size that such steels have), in fine steps."""
    count = len(strain)
    fine = np.interp(np.linspace(0, count - 1, 20 * count), np.arange(count), strain)
    modulus, c, g = 185e3, np.array([26e3, 2445.0]), np.array([173.0, 9.7])
    back, plastic, path, out = np.zeros(2), 0.0, 0.0, np.zeros(len(fine))
    for i, e in enumerate(fine):
        radius = 332 + 120 * (1 - np.exp(-9 * path)) - 64 * (1 - np.exp(-210 * path))
        off = modulus * (e - plastic) - back.sum()
        if abs(off) > radius:
            sign = np.sign(off)
            hardens = 1080 * np.exp(-9 * path) - 13440 * np.exp(-210 * path)
            step = (abs(off) - radius) / (modulus + hardens + np.sum(c - g * back * sign))
            plastic, path = plastic + sign * step, path + step
            back = back + (c * sign - g * back) * step
        out[i] = modulus * (e - plastic)
    return out[np.round(np.linspace(0, len(fine) - 1, count)).astype(int)]


def strained(uncertainty_N: float) -> GapData:
    """A coupon of that steel in cycles of 0.5, 1, 2 and 4 %, as its machine drives it."""
    way = np.array([0.0, *(s * a for a in (0.5, 1.0, 2.0, 4.0) for s in (1, -1))])
    along = np.append(0.0, np.cumsum(np.abs(np.diff(way))))
    strain = 1e-2 * np.interp(np.linspace(0, along[-1], 1000), along, way)
    rng = np.random.default_rng(1)
    force = 100 * metal(strain) + rng.normal(0, 0.6 * uncertainty_N, 1000)
    moved = 0.05 * strain + rng.normal(0, 8e-7, 1000)
    return running(
        force,
        moved,
        instruments=Instruments(uncertainty_N, 2e-6, 0.005, 0.003),
        compliance=np.array([1 / 3.57e8]),
        compliance_relative_sd=np.array([0.05]),
    )


@pytest.mark.slow
@pytest.mark.parametrize("uncertainty_N", [pytest.param(30.0, marks=pytest.mark.slow), 100.0])
def test_metal_in_growing_cycles_yields_and_does_not_creep(uncertainty_N: float) -> None:
    """Though creep beside the yield explains its changing loops, or foretells as much alone, and a
    spring takes over most of what either does."""
    assert explained(strained(uncertainty_N)).verdict in ("joint_yield", "joint_hysteresis")


def ratcheted(
    force: Array, knee: float = 55.0, hardening: float = 4e5, recall: float = 6e3
) -> Array:
    """m of a bar whose yield surface follows as Armstrong and Frederick say: in cycles about a mean
    load it walks a little further in each."""
    back, plastic, out = 0.0, 0.0, []
    for before, now in zip(np.append(0.0, force[:-1]), force, strict=True):
        for f in np.linspace(before, now, 20)[1:]:
            over, sense = abs(f - back) - knee, np.sign(f - back)
            if over > 0:
                step = over / (hardening - recall * back * sense) * sense
                plastic += step
                back += hardening * step - recall * back * abs(step)
        out.append(f / SPRING + plastic)
    return np.array(out)


@pytest.mark.slow
@pytest.mark.parametrize("mean", [15.0, 0.0])
def test_what_yields_walks_the_way_of_a_mean_load_and_heat_walks_without(mean: float) -> None:
    cycles, n = 10, 600
    force = mean + 65 * np.sin(2 * np.pi * cycles * np.arange(n) / n)
    shown = ratcheted(force)
    if not mean:  # nothing ratchets, and the room gets warm
        shown = shown + 3e-4 * np.arange(n) / n
    noise = np.random.default_rng(2).normal(0, 1e-6, n)
    found = explained(running(force, shown + noise, imposed="force", instruments=METER))
    assert "thermal_drift" in found.names or "force_drift" in found.names
    assert (found.verdict in ("joint_yield", "joint_hysteresis")) is (mean > 0)


def bears(u: Array, radius: float) -> Array:
    """What gives way at a radius and wears its hole by that, on either side; row by row."""
    out, holes = np.zeros_like(u), {1.0: 0.0, -1.0: 0.0}
    for i, at in enumerate(u):
        for sign, worn in holes.items():
            out[i] += sign * max(sign * at - worn, 0.0)
            holes[sign] = max(worn, sign * at - radius)
            out[i] -= sign * max(sign * at - worn - radius, 0.0)
    return out


def to_and_fro(cycles: int = 4, n: int = 60) -> Array:
    """m: further each time, to either side, twice each."""
    ends = [STROKE * (1 + k // 2) / (cycles // 2) for k in range(cycles)]
    corners = [0.0, *(x for end in ends for x in (end, -end)), 0.0]
    return np.concatenate([np.linspace(a, b, n) for a, b in pairwise(corners)])


def test_what_wears_its_hole_bears_where_it_was_last_pushed_to() -> None:
    u = to_and_fro()
    start = np.arange(len(u)) == 0
    path = Path(u, start, start, np.ones(len(u), dtype=bool))
    radius = STROKE * np.array([0.05, 0.2, 2.0])
    exact = np.stack([bears(u, float(r)) for r in radius], axis=1)
    np.testing.assert_allclose(path.slacks(radius), exact, atol=1e-15)
    np.testing.assert_allclose(exact[:, 2], u)  # never worn: a spring
    twice = np.concatenate([u, u])
    anew = Path(twice, np.tile(start, 2), np.tile(start, 2), np.ones(len(twice), dtype=bool))
    np.testing.assert_allclose(anew.slacks(radius), np.tile(exact, (2, 1)), atol=1e-15)


def test_a_wall_that_hardly_gives_way_has_no_element_twice() -> None:
    u = to_and_fro(8)
    bench = make_bench(recording(u, SPRING * u * 0.97))
    for v in library(bench, ["joint_hysteresis"]):
        if v.info.get("slackens"):
            radius = np.asarray(v.info["radius"])[: v.info["slackens"]]
            assert np.all(np.diff(radius) > 0)
            assert len({bench.columns[c].tobytes() for c in v.columns}) == len(v.columns)


def test_what_never_slips_beside_an_imposed_motion_is_a_spring() -> None:
    """Half as much again, of the spring or of what never slips: the friction is the same share."""
    u = to_and_fro(8)
    bench = make_bench(recording(u, rubbed(u)))
    v = next(v for v in library(bench, ["joint_hysteresis"]) if v.info["law"] == "Iwan")
    k, joint = len(v.columns), int(v.info["joint"])
    rubs = 0.3 * np.eye(k)[0]
    shares = []
    for w, stiffer in ((rubs, 0.5), (rubs + 0.5 * np.eye(k)[-1], 0.0)):
        beside = ComplianceChange({joint: stiffer}, {joint: 0.0}, {joint: np.zeros(k)})
        found = parameters(bench, v, Coefficients(w, 1e-9 * np.eye(k), beside))
        shares.append(found["share_through_friction"].value)
    assert shares[0] == pytest.approx(shares[1])


def test_a_loop_that_is_pinched_is_friction_that_wears() -> None:
    """Nails in timber: every strength wears its hole; beside them some friction."""
    u = to_and_fro(8)
    spread = STROKE * np.array([0.04, 0.1, 0.17, 0.3, 0.42])
    force = SPRING * sum(bears(u, float(r)) for r in spread) / 5 + 0.2 * rubbed(u, 8.0)
    data = recording(u, np.asarray(force))
    found = explained(data)
    assert found.verdict == "joint_hysteresis"
    assert found.probabilities["joint_hysteresis"] > 0.6
    shown = found.found.explanations[0].parts[0].variant
    assert shown.info["slackens"] > 0
    bench = make_bench(data)
    worn = [v for v in library(bench, ["joint_hysteresis"]) if v.info.get("slackens")]
    assert_lawful(bench, worn)
    survive(bench, worn)
    for v in worn:  # a wall that hardly gives way as well: no element twice, none beyond the stroke
        assert np.all(np.diff(v.info["radius"][: v.info["slackens"]]) > 0)
    one_way = make_bench(recording(*flowed(strokes())))
    assert not any(v.info.get("slackens") for v in library(one_way, ["joint_hysteresis"]))
