"""Lost motion and curves of rigs without an arm: placed by the data, and never where there are
none."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.forms import law_of, rows_of
from identification.gap.effects import joint_backlash, joint_nonlinear_stiffness
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, part_sizes
from identification.gap.explanations.penalties import minor_parts
from identification.gap.laws.flanks import Flanks, _crossed, placed
from identification.gap.laws.lost_motion import MOST_RUB, PLACED
from identification.gap.model.base import base_columns
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from tests.unit.test_gap_operators import bench_data

N, K = 480, 1e5  # samples, each a row; N/m of the simulated spring
TOP = 100.0  # N, and TOP / K m


def to_and_fro(low: float = -1.0, cycles: int = 4) -> Array:
    """(N,) triangles from 0 to 1 and `low`."""
    points = [0.0, *[1.0, low] * cycles]
    return np.interp(np.linspace(0, len(points) - 1, N), np.arange(len(points)), points)


def held(x: Array, radius: float) -> Array:
    """Play: what friction of `radius` lets through of a load."""
    out, state = np.empty_like(x), 0.0
    for i, v in enumerate(x):
        state = min(max(state, v - radius), v + radius)
        out[i] = state
    return out


def a_bench(force: Array, moved: Array, imposed: str) -> Bench:
    """force in TOP, moved in TOP / K; noise of a ten-thousandth."""
    rng = np.random.default_rng(0)
    data = bench_data(
        TOP * (force + 1e-4 * rng.standard_normal(N)),
        TOP / K * (moved + 1e-4 * rng.standard_normal(N)),
        time=np.arange(N) * 1.0,
        step=np.full(N, -1),
        branch=np.full(N, 3),
        run=np.zeros(N, dtype=np.int64),
        repetition=np.ones(N, dtype=np.int64),
        imposed=imposed,
    )
    known = replace(data.instruments, force=1e-4 * TOP, displacement=1e-4 * TOP / K)
    return make_bench(replace(data, instruments=known))


def gap(half: float, centre: float = 0.0, spring: float = 1.0, rub: float = 0.0) -> Bench:
    """No force within the gap but friction, springs beyond it."""
    u = to_and_fro()
    x = u - centre
    force = spring * (x - np.clip(x, -half, half)) + rub * (x - held(x, 0.01)) / 0.01
    return a_bench(force, u, "displacement")


def teeth(radius: float, centre: float = 0.0) -> Bench:
    """Flanks that change once the load has turned by the friction, by 0.6 in all."""
    x = to_and_fro()
    moved = x + 0.3 * np.tanh(held(x - centre, radius) / (0.3 * radius))
    return a_bench(x, moved, "force")


@pytest.mark.parametrize(("half", "centre"), [(0.05, 0.0), (0.21, 0.1), (0.45, -0.13)])
@pytest.mark.parametrize("spring", [1.0, 0.15, 6.0])
def test_a_gap_is_found_where_it_is_whatever_the_springs(
    half: float, centre: float, spring: float
) -> None:
    bench = gap(half, centre, spring, rub=0.02 * spring)
    found = placed(bench, bench.torque[:, 0])
    assert found is not None
    assert found.kind == "gap"
    assert found.centre / TOP == pytest.approx(centre, abs=0.01)
    assert found.zone / TOP == pytest.approx(half, abs=0.01)


@pytest.mark.parametrize(("radius", "centre"), [(0.01, 0.0), (0.05, -0.2), (0.12, 0.3)])
def test_flanks_that_friction_holds_are_found(radius: float, centre: float) -> None:
    bench = teeth(radius, centre)
    found = placed(bench, bench.torque[:, 0])
    assert found is not None
    assert found.kind == "held"
    assert found.centre / TOP == pytest.approx(centre, abs=0.01)
    assert found.friction / TOP == pytest.approx(radius, rel=0.2)


def dragged(half: float, radius: float, centre: float, driven: str) -> Bench:
    """Friction of `radius` within the gap alone, as of grease: the joint is dragged through it."""
    x = to_and_fro()
    place = np.clip(held(x - centre, radius), -half, half)
    if driven == "force":
        return a_bench(x, x + 2 * place, "force")
    return a_bench(x - 0.9 * place, x, "displacement")


@pytest.mark.parametrize("driven", ["force", "displacement"])
@pytest.mark.parametrize(("half", "radius", "centre"), [(0.15, 0.06, 0.0), (0.1, 0.04, 0.2)])
def test_plays_that_rub_within_are_found(
    half: float, radius: float, centre: float, driven: str
) -> None:
    bench = dragged(half, radius, centre, driven)
    found = placed(bench, bench.torque[:, 0])
    assert found is not None
    assert found.kind == "dragged"
    assert found.centre / TOP == pytest.approx(centre, abs=0.01)
    assert found.zone / TOP == pytest.approx(half, rel=0.1)
    assert found.friction / TOP == pytest.approx(radius, rel=0.15)


def carried(half: float, start: float, spring: float = 1.0) -> Bench:
    """The far side stays where it is until the play was passed: backlash at every turn."""
    x = to_and_fro()
    return a_bench(spring * held(x - start, half), x, "displacement")


@pytest.mark.parametrize(("half", "start"), [(0.05, 0.0), (0.2, 0.15), (0.6, -0.4)])
@pytest.mark.parametrize("spring", [1.0, 0.15, 6.0])
def test_a_play_that_friction_on_the_far_side_carries_along_is_found(
    half: float, start: float, spring: float
) -> None:
    bench = carried(half, start, spring)
    found = placed(bench, bench.torque[:, 0])
    assert found is not None
    assert found.kind == "carried"
    assert found.zone / TOP == pytest.approx(half, rel=0.05)


@pytest.mark.parametrize(("kind", "ends"), [("gap", 0.2), ("held", 0.1), ("dragged", 0.3)])
def test_a_play_ends_where_friction_lets_it(kind: str, ends: float) -> None:
    """It has to be passed by 0.03 of the range, of 2 here, at either end."""
    load = TOP * to_and_fro()
    for side in (1.0, -1.0):
        for margin, seen in ((0.01, True), (-0.01, False)):
            centre = side * (1.0 - 0.06 - ends - margin) * TOP
            found = Flanks(kind, centre, 0.2 * TOP, 0.01 * TOP, 0.1 * TOP)
            assert _crossed(load, found) == seen


def test_a_play_that_is_carried_along_is_passed_anywhere() -> None:
    load = TOP * to_and_fro()
    for half, seen in ((0.93, True), (0.95, False)):
        assert _crossed(load, Flanks("carried", 0.7 * TOP, half * TOP, half * TOP, TOP)) == seen


def test_a_contact_that_is_met_once_is_no_play() -> None:
    """Let go at first, then met: a play that is carried along goes either way."""
    x = np.interp(np.linspace(0, 3, N), [0, 2, 3], [0.0, -1.0, 0.5])
    assert placed(a_bench(np.maximum(x, 0.0), x, "displacement"), TOP * x) is None


def test_what_snaps_back_while_it_is_pushed_on_is_no_play() -> None:
    """The force falls as the stroke goes on: a magnet lets go, a shell snaps through."""
    x = to_and_fro()
    bench = a_bench(x - 3 * np.clip(held(x, 0.2), -0.1, 0.1), x, "displacement")
    assert placed(bench, bench.torque[:, 0]) is None


def a_curve(imposed: str) -> Bench:
    x = to_and_fro()
    curved = x + 2 * x**3
    return a_bench(curved, x, imposed) if imposed == "displacement" else a_bench(x, curved, imposed)


def a_loop(imposed: str) -> Bench:
    x = to_and_fro()
    loop = x + 0.5 * (x - held(x, 0.2))
    return a_bench(loop, x, imposed) if imposed == "displacement" else a_bench(x, loop, imposed)


def slips(imposed: str) -> Bench:
    """Plastic loops: stiff after every turn, then hardly."""
    x = to_and_fro()
    loop = 0.3 * x + (x - held(x, 0.05))
    return a_bench(loop, x, imposed)


def one_sided() -> Bench:
    """Slack from zero on: one flank is never seen."""
    u = to_and_fro(low=0.0)
    return a_bench(np.maximum(u - 0.3, 0.0), u, "displacement")


@pytest.mark.parametrize(
    "bench",
    [
        a_curve("displacement"),
        a_curve("force"),
        a_loop("displacement"),
        a_loop("force"),
        slips("displacement"),
        one_sided(),
        a_bench(to_and_fro(), to_and_fro(), "force"),
    ],
    ids=["curve, stroke", "curve, load", "loop, stroke", "loop, load", "slips", "one side", "line"],
)
def test_no_play_is_placed_where_there_is_none(bench: Bench) -> None:
    assert placed(bench, bench.torque[:, 0]) is None


@pytest.mark.parametrize(
    "bench",
    [
        gap(0.2, 0.1, rub=0.02),
        carried(0.2, 0.1),
        teeth(0.05, 0.1),
        dragged(0.15, 0.06, 0.1, "displacement"),
    ],
    ids=["gap", "carried", "teeth", "dragged"],
)
def test_placed_plays_are_their_laws_and_explain_the_data(bench: Bench) -> None:
    fresh = replace(bench, columns=Pool())
    made = [v for v in joint_backlash.variants(fresh) if v.info["kind"] in PLACED]
    assert len(made) == 2
    pool = np.column_stack(fresh.columns)
    n = fresh.rows.n
    line = np.column_stack([np.ones(n), fresh.load])
    for v in made:
        law, scale = law_of(fresh, v)
        columns = pool[:, list(v.columns)]
        np.testing.assert_allclose(rows_of(fresh, v.word, law) * scale, columns, atol=1e-15)
        fitted = np.column_stack([line, columns[:n]])
        left = fresh.response - fitted @ np.linalg.lstsq(fitted, fresh.response, rcond=None)[0]
        bare = fresh.response - line @ np.linalg.lstsq(line, fresh.response, rcond=None)[0]
        assert left.std() < 0.05 * bare.std()


def test_friction_beside_a_play_is_the_lesser_part() -> None:
    """More of it is hysteresis: such coefficients count as of the wrong sign. Inside an imposed
    gap there is no such bound."""
    for v in joint_backlash.variants(replace(teeth(0.05), columns=Pool())):
        assert v.positive is not None
        share = np.zeros(len(v.columns))
        share[:2] = 1.0, 0.9 * MOST_RUB
        assert v.positive @ share > 0
        share[1] = 1.1 * MOST_RUB
        assert v.positive @ share < 0
    inside = [
        v
        for v in joint_backlash.variants(replace(gap(0.2), columns=Pool()))
        if v.info["kind"] == "gap"
    ]
    assert inside
    assert all(v.positive is not None and v.positive[1] == 0 for v in inside)


def foam(u: Array) -> Array:
    """Steep, flat, and steeper than ever."""
    return 1 - np.exp(-u / 0.05) + 0.2 * u + 0.3 * u / (1.06 - u)


@pytest.mark.parametrize("start", [0.0, 0.2])
def test_a_fine_curve_carries_foam_that_is_squeezed_flat(start: float) -> None:
    u = start + (1 - start) * to_and_fro(low=0.0)
    bench = replace(a_bench(foam(u - start), u, "displacement"), columns=Pool())
    made = joint_nonlinear_stiffness.variants(bench)
    fine = [v for v in made if v.label.endswith("fine curve")]
    assert len(fine) == 1
    pool, n = np.column_stack(bench.columns), bench.rows.n

    def left(columns: tuple[int, ...]) -> float:
        shapes = np.column_stack([np.ones(n), pool[:n, list(columns)]])
        fitted = shapes @ np.linalg.lstsq(shapes, bench.response, rcond=None)[0]
        return float(np.std(bench.response - fitted) / np.std(bench.response))

    coarse = next(v for v in made if v.label.endswith("1 curve"))
    assert left(fine[0].columns) < 0.01
    assert left(fine[0].columns) < 0.3 * left(coarse.columns)
    law, scale = law_of(bench, fine[0])
    np.testing.assert_allclose(
        rows_of(bench, fine[0].word, law) * scale, pool[:, list(fine[0].columns)], atol=1e-12
    )


def test_a_pull_without_a_way_back_has_no_fine_curve() -> None:
    """What is not unloaded may be yield as well; the finer curve must not win by its freedom."""
    u = np.linspace(0, 1, N)
    bench = replace(a_bench(foam(u), u, "displacement"), columns=Pool())
    assert not [v for v in joint_nonlinear_stiffness.variants(bench) if "fine" in v.label]


@pytest.mark.parametrize(("column", "plays"), [(0, True), (1, False)])
def test_what_only_rubs_is_no_play_that_a_curve_takes_back(column: int, plays: bool) -> None:
    """Of what the play and the friction beside it do in a variant, one is all that was seen."""
    bench = replace(teeth(0.05), columns=Pool())
    play = next(v for v in joint_backlash.variants(bench) if v.info["kind"] == "friction")
    curve = next(iter(joint_nonlinear_stiffness.variants(bench)))
    target = 3e-4 * bench.columns[play.columns[column]]
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-7]))
    parts = (Part(play, 1e-3), Part(curve, 1e-6))
    found = part_sizes(engine, parts, 0)
    assert found.signed == (plays, True)
    alike = replace(found, gap=np.array([1e-5, 1e-5]), moved=np.array([1e-5, 1e-5]))
    assert (minor_parts(engine, parts, alike) > 5e3) == (not plays)
    on_arm = copy(engine)
    on_arm.bench = replace(bench, data=replace(bench.data, arm=True))
    assert minor_parts(on_arm, parts, alike) < 5e3


def test_from_one_side_both_flanks_of_a_play_have_to_be_seen() -> None:
    """What is soft where the load begins is a seat."""
    x = to_and_fro(low=0.0)
    bench = a_bench(x, x + 0.4 * np.tanh(x / 0.03), "force")
    assert bench.load_history.one_sided
    made = joint_backlash.variants(bench)
    assert made
    for v in [*made, *(f for m in made[:4] for f in joint_backlash.refined(bench, m))]:
        away = bench.true_torque[:, 0] + v.info["preload_Nm"]
        assert min(-away.min(), away.max()) >= 2 * v.info["zone_Nm"]
