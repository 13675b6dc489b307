"""k with its budget, choices and statuses, on curves made by hand."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.curve import Curve, Point
from identification.estimate import Choice, gain_effect, stated_uncertainty, stiffness
from identification.levels import LevelTable
from identification.stiffness import WRONG_WAY, Options, Stiffness, analyze_curve, ratio

LEVELS = (20.0, 40.0, 60.0, 80.0, 100.0)
FACTORS = (1.0, 1.01, 0.99)  # compliance of the three repetitions


def curve(
    law: Callable[[float], float] = lambda f: f / 1e5,
    levels: Sequence[float] = LEVELS,
    factors: Sequence[float] = FACTORS,
    gains: tuple[float, float] = (0.0, 0.0),
) -> Curve:
    points = [
        Point(r, "loading", step, f, factor * law(f), 0.1, 2e-6, 5)
        for r, factor in enumerate(factors, start=1)
        for step, f in enumerate(levels, start=1)
    ]
    return Curve("P1", "x", (1.0, 0.0, 0.0), tuple(points), *gains)


def unloading(c: Curve, law: Callable[[float], float], remaining: float) -> Curve:
    back = [
        Point(r, "unloading", step, f, law(f), 0.1, 2e-6, 5)
        for r in (1, 2, 3)
        for step, f in reversed(list(enumerate(LEVELS, start=1)))
    ]
    ends = [Point(r, "zero", 0, 0.0, remaining, 0.1, 2e-6, 5) for r in (1, 2, 3)]
    return replace(c, points=(*c.points, *back, *ends))


def table(force: Sequence[float], displacement: Sequence[float]) -> LevelTable:
    n = len(force)
    return LevelTable(
        np.array(force),
        np.array(displacement),
        np.full(n, 0.1),
        np.full(n, 1e-9),
        np.full(n, np.nan),
    )


def k_of(result: Stiffness) -> float:
    assert result.k is not None
    return result.k.value


def test_the_published_convention_in_closed_form() -> None:
    """Through the origin, s in proportion to u: sum of the secants squared over their sum."""
    force, displacement = np.array([10.0, 20.0, 30.0]), np.array([1e-4, 2.2e-4, 4e-4])
    secants = force / displacement
    expected = float(np.sum(secants**2) / np.sum(secants))
    assert stiffness(table(force, displacement), Choice()) == pytest.approx(expected, rel=1e-8)


def test_the_published_x_curve_gives_the_published_stiffness() -> None:
    """133 N/mm at zero load, 0.73 mm at 75 N, 3.09 mm at 220 N; levels of 20 N to 220 N."""
    levels = np.arange(20.0, 221.0, 20.0)
    softening = curve(lambda f: f / 133e3 * (1 + f / 256.0), levels)
    assert k_of(analyze_curve(softening)) * 1e-3 == pytest.approx(95.94, rel=0.005)


def test_type_a_is_the_scatter_of_the_repetitions() -> None:
    result = analyze_curve(curve())
    each = 1e5 / np.array(FACTORS)
    assert result.by_repetition == pytest.approx(each)
    assert result.k is not None
    assert result.k.u == pytest.approx(np.std(each, ddof=1) / math.sqrt(3))
    assert result.k.dof == pytest.approx(2.0)
    assert result.k.interval[1] - result.k.value == pytest.approx(4.30265 * result.k.u, rel=1e-5)


def test_type_b_is_the_gains_in_quadrature() -> None:
    result = analyze_curve(curve(factors=(1.0, 1.0, 1.0), gains=(0.005, 0.003)))
    assert result.k is not None
    assert result.k.u / result.k.value == pytest.approx(math.hypot(0.005, 0.003), rel=1e-3)
    assert [c.kind for c in result.budget if c.counted] == ["A", "B", "B"]


def test_a_single_repetition_falls_back_on_what_was_stated() -> None:
    result = analyze_curve(curve(factors=(1.0,)))
    assert result.k is not None
    assert result.k.u > 0
    assert "scatter between runs unseen" in result.budget[0].name
    assert result.budget[0].kind == "B"


def test_the_stated_uncertainty_of_one_level_is_that_of_its_secant() -> None:
    """u(k) / k = sqrt((u_F / F)^2 + (u_u / u)^2)."""
    one = LevelTable(*(np.array([v]) for v in (50.0, 5e-4, 0.5, 1e-6, np.nan)))
    expected = 1e5 * math.hypot(0.01, 0.002)
    assert stated_uncertainty(one, Choice()) == pytest.approx(expected, rel=1e-4)


def test_the_stated_uncertainty_of_many_levels_agrees_with_that_of_few() -> None:
    """Straight line, equal weights: the closed form beyond 200 levels and the differences below."""

    def stated(n: int) -> float:
        force = np.linspace(10.0, 100.0, n)
        many = LevelTable(force, force / 1e5, np.full(n, 0.1), np.full(n, 1e-6), np.full(n, np.nan))
        return stated_uncertainty(many, Choice("none", intercept=True)) * math.sqrt(n)

    assert stated(201) == pytest.approx(stated(200), rel=0.005)


def test_a_gain_moves_the_levels_of_a_curved_line() -> None:
    """u = c F^2: k at a level goes as 1 / F, so a gain counts twice: once itself, once there."""
    force = np.array([20.0, 40.0, 60.0])
    straight, bent = table(force, force / 1e5), table(force, force**2 / 1e7)
    assert gain_effect(straight, Choice(), 0.01) / 1e5 == pytest.approx(0.01, rel=1e-3)
    k = stiffness(bent, Choice())
    assert gain_effect(bent, Choice(), 0.01) / k == pytest.approx(0.02, rel=1e-3)


def test_a_gain_that_is_worth_more_than_stated_is_told_with_its_share() -> None:
    stated = (0.005, 0.003)
    bent = analyze_curve(curve(lambda f: f / 1e5 * (1 + f / 200), gains=stated))
    (gain,) = (c for c in bent.budget if c.name == "gain of the force")
    note = (
        f"The gain of the force is stated to 0.5 %, and is worth {100 * gain.u / k_of(bent):.3g} "
        "% of k: it moves the levels, too, over which a curve that is not straight is averaged."
    )
    assert note in bent.notes
    assert gain.u / k_of(bent) > 1.1 * stated[0]
    straight = analyze_curve(curve(gains=stated))
    assert not [n for n in straight.notes if "gain of the force" in n]


def test_pointwise_stiffness_mean_and_sd_over_the_repetitions() -> None:
    result = analyze_curve(curve())
    each = 1e5 / np.array(FACTORS)
    assert len(result.pointwise) == len(LEVELS)
    for p, middle in zip(result.pointwise, (10.0, 30.0, 50.0, 70.0, 90.0), strict=True):
        assert p.force == pytest.approx(middle)
        assert p.stiffness == pytest.approx(np.mean(each))
        assert p.sd == pytest.approx(np.std(each, ddof=1))
        assert p.n == 3


def test_pointwise_stiffness_where_nothing_moved_is_no_number() -> None:
    flat = curve(lambda f: min(f, 60.0) / 1e5, factors=(1.0, 1.0))
    assert math.isnan(analyze_curve(flat).pointwise[-1].stiffness)


def test_the_curve_is_mean_and_sd_per_level() -> None:
    level = analyze_curve(curve()).levels[2]
    assert (level.step, level.n, level.branch) == (3, 3, "loading")
    assert level.displacement == pytest.approx(60.0 / 1e5)
    assert level.sd == pytest.approx(60.0 / 1e5 * 0.01)


KNEE_LEVELS = (7.5, 15, 22.5, 30, 37.5, 45, 52.5, 60, 67.5, 75, 78, 82)


def giving_way(force: float) -> float:
    return force / 57420.0 if force < 75.0 else 75.0 / 57420.0 + (force - 75.0) / 1250.0


def test_steps_after_a_knee_are_left_out_and_named() -> None:
    result = analyze_curve(curve(giving_way, KNEE_LEVELS, gains=(0.005, 0.003)))
    assert result.knee is not None
    assert result.knee.force.value == pytest.approx(75.0, abs=0.1)
    assert result.knee.force.interval[0] < 75.0 < result.knee.force.interval[1]
    assert [e.step for e in result.excluded] == [11, 12]
    assert "after the knee at 75.0 N" in result.excluded[0].reason
    assert k_of(result) == pytest.approx(57420.0, rel=1e-3)


def test_steps_after_a_knee_count_on_request() -> None:
    result = analyze_curve(curve(giving_way, KNEE_LEVELS), Options(keep_after_knee=True))
    assert result.knee is not None
    assert result.excluded == ()
    assert k_of(result) < 0.98 * 57420.0


def test_the_consequences_of_other_choices_are_shown() -> None:
    result = analyze_curve(curve(giving_way, KNEE_LEVELS))
    rivals = {(a.choice, a.after_knee): a.value for a in result.alternatives}
    assert len(rivals) == 7 + 8
    assert (result.choice, False) not in rivals
    assert rivals[Choice("none", intercept=True), True] < 25e3  # straight through the knee
    assert rivals[Choice("none", intercept=True), False] == pytest.approx(57420.0, rel=1e-3)


def test_only_loading_counts_and_the_loop_is_reported() -> None:
    """Unloading along u = F / 0.8e5 from 1e-3 m down to 0.25e-3 m (at F = 0)."""
    loop = unloading(curve(factors=(1.0, 1.0, 1.0)), lambda f: f / 1.333333e5 + 0.25e-3, 0.25e-3)
    result = analyze_curve(loop)
    assert k_of(result) == pytest.approx(1e5)
    assert result.hysteresis is not None
    assert result.hysteresis.area == pytest.approx(0.5 * 100.0 * 0.25e-3, rel=1e-4)
    assert result.hysteresis.relative == pytest.approx(0.25, rel=1e-4)
    assert result.hysteresis.remaining == pytest.approx(0.25e-3)
    assert {p.branch for p in result.levels} == {"loading", "unloading"}


def test_unloading_beyond_the_largest_load_is_no_part_of_the_loop() -> None:
    """Loading ended at 60 N; levels of 100 and 80 N were held after it all the same."""
    short = curve(levels=LEVELS[:3], factors=(1.0, 1.0, 1.0))
    back = unloading(short, lambda f: f / (1e5 if f <= 60 else 3e4), 0.0)
    beyond = analyze_curve(back).hysteresis
    assert beyond is not None
    assert beyond.area == pytest.approx(0.0, abs=1e-9)


def test_without_a_measured_origin_the_line_may_miss_it() -> None:
    offset = replace(curve(lambda f: 1e-4 + f / 1e5, factors=(1.0, 1.0)), origin=False)
    result = analyze_curve(offset)
    assert result.choice == Choice("none", intercept=True)
    assert "no unloaded state was measured" in result.choice_reason
    assert k_of(result) == pytest.approx(1e5)
    assert result.intercept == pytest.approx(1e-4)
    assert len(result.pointwise) == len(LEVELS) - 1


@pytest.mark.parametrize("weighting", ["proportional", "1/s^2", "none", "errors-in-variables"])
@pytest.mark.parametrize("intercept", [False, True])
def test_every_choice_agrees_on_a_straight_line(weighting: str, intercept: bool) -> None:
    wish = Options(weighting, intercept)  # type: ignore[arg-type]
    result = analyze_curve(curve(factors=(1.0, 1.0, 1.0)), wish)
    assert k_of(result) == pytest.approx(1e5, rel=1e-6)
    assert result.choice_reason == "as asked for"


def test_ratio_without_the_common_gains() -> None:
    a = analyze_curve(curve(gains=(0.05, 0.05)))
    b = analyze_curve(curve(lambda f: f / 0.5e5, gains=(0.05, 0.05)))
    q = ratio(a, b)
    assert q is not None
    assert a.k is not None
    assert q.value == pytest.approx(2.0)
    alone = np.std(1.0 / np.array(FACTORS), ddof=1) / math.sqrt(3)
    assert q.u == pytest.approx(2.0 * math.sqrt(2.0) * alone, rel=0.01)
    assert q.u < 0.2 * a.k.u / a.k.value * 2.0


def nan_at(c: Curve, step: int) -> Curve:
    points = [replace(p, displacement=math.nan) if p.step == step else p for p in c.points]
    return replace(c, points=tuple(points))


UNDEFINED = [
    (curve(levels=()), "there are no loaded levels"),
    (curve(levels=(0.0, 0.0)), "the force is 0 N from its zero throughout"),
    (replace(curve(levels=(50.0,)), origin=False), "one level only"),
    (curve(lambda _: 0.0), "the displacement is the same at every force"),
    (
        curve(lambda f: 1e-4 * math.sin(900 * f), (0.01, 0.02, 0.05, 0.03, 0.015)),
        "within its uncertainty of 0.1 N",
    ),
]


@pytest.mark.parametrize(("c", "text"), UNDEFINED)
def test_undefined_stiffness_is_a_sentence(c: Curve, text: str) -> None:
    result = analyze_curve(c)
    assert result.status == "undefined"
    assert result.k is None
    assert text in result.sentence
    assert ratio(result, analyze_curve(curve())) is None


def test_a_level_without_value_is_left_out_and_named() -> None:
    result = analyze_curve(nan_at(curve(), 3))
    assert k_of(result) == pytest.approx(1e5, rel=1e-3)
    assert [e.step for e in result.excluded] == [3, 3, 3]
    assert result.excluded[0].reason == "repetition 1: no valid value of force or displacement"


def test_one_level_over_a_measured_zero_has_a_stiffness() -> None:
    assert k_of(analyze_curve(curve(levels=(50.0,)))) == pytest.approx(1e5, rel=1e-3)


@pytest.mark.parametrize(
    ("bend", "text"),
    [(0.0, ""), (0.1, ""), (1.0, "falls from 87.4 to 57.27 N/mm"), (-0.4, "rises from 106.5 to")],
)
def test_a_curve_whose_stiffness_changes_is_told(bend: float, text: str) -> None:
    """Between levels f and g it is 100 / (1 + bend (f + g) / 200) N/mm; means of the first and the
    last three of nine. A tenth in all is no matter."""
    levels = tuple(10.0 * (k + 1) for k in range(9))
    result = analyze_curve(curve(lambda f: (f + bend * f**2 / 200) / 1e5, levels))
    told = [n for n in result.notes if "between neighbouring levels" in n]
    assert len(told) == bool(text)
    if told:
        assert text in told[0]
        values = [a.value / 1e3 for a in result.alternatives]
        assert f"other choices give {min(values):.4g} to {max(values):.4g} N/mm" in told[0]
    alone = analyze_curve(curve(lambda f: (f + bend * f**2 / 200) / 1e5, levels, (1.0,)))
    assert not [n for n in alone.notes if "between neighbouring" in n]  # its scatter is unknown


def test_a_line_that_explains_little_is_doubtful() -> None:
    bent = curve(lambda f: 1e-3 * math.sin(f / 16.0), factors=(1.0, 1.0))
    assert analyze_curve(bent).status == "doubtful"
    assert analyze_curve(curve(lambda f: -f / 1e5)).status == "doubtful"


@cache
def softening() -> tuple[Curve, Stiffness]:
    base = curve(lambda f: f / 1e5 * (1 + f / 200.0))
    return base, analyze_curve(base)


@settings(max_examples=30, deadline=None)
@given(force=st.floats(1e-6, 1e4), displacement=st.floats(1e-7, 1e3))
def test_scales_from_micronewtons_to_meganewtons(force: float, displacement: float) -> None:
    base, one = softening()
    scaled = replace(
        base,
        points=tuple(
            replace(
                p,
                force=p.force * force,
                displacement=p.displacement * displacement,
                u_force=p.u_force * force,
                u_displacement=p.u_displacement * displacement,
            )
            for p in base.points
        ),
    )
    other = analyze_curve(scaled)
    assert k_of(other) == pytest.approx(k_of(one) * force / displacement, rel=1e-9)
    assert other.status == one.status
    assert (other.knee is None) == (one.knee is None)


def test_a_level_that_the_first_run_skipped_stands_where_it_belongs() -> None:
    whole = curve()
    gap = [p for p in whole.points if not (p.repetition == 1 and p.step in (1, 3))]
    result = analyze_curve(replace(whole, points=tuple(gap)))
    assert [p.step for p in result.levels] == [1, 2, 3, 4, 5]
    assert [p.n for p in result.levels] == [2, 3, 2, 3, 3]
    assert [p.force for p in result.pointwise] == pytest.approx([10.0, 30.0, 50.0, 70.0, 90.0])


def test_levels_that_no_run_has_together_stand_in_the_order_of_their_numbers() -> None:
    whole = unloading(curve(), lambda f: f / 1e5 + 1e-4, 1e-4)
    lacking = {1: (3, 4), 2: (4,), 3: (3,)}
    kept = [p for p in whole.points if p.step not in lacking[p.repetition]]
    kept += [replace(p, repetition=4) for p in whole.points if p.repetition == 3 and p.step != 4]
    result = analyze_curve(replace(whole, points=tuple(kept)))
    assert [(p.branch, p.step) for p in result.levels] == [
        *(("loading", step) for step in (1, 2, 3, 4, 5)),
        *(("unloading", step) for step in (5, 4, 3, 2, 1)),
    ]
    # no run has both 3 and 4
    assert [p.force for p in result.pointwise] == pytest.approx([10.0, 30.0, 50.0, 90.0])
    assert all(p.n > 0 for p in result.pointwise)


@pytest.mark.parametrize(("back", "told"), [(-0.25e-3, True), (0.0, False), (0.25e-3, False)])
def test_a_loop_that_gives_back_more_than_it_took_is_told(back: float, told: bool) -> None:
    slope = 1e5 / (1 - back / 1e-3)
    loop = unloading(curve(factors=(1.0, 1.0, 1.0)), lambda f: f / slope + back, back)
    assert (WRONG_WAY in analyze_curve(loop).notes) is told


def test_the_loop_of_a_cycle_without_zero_has_an_area_and_no_share() -> None:
    loop = unloading(curve(factors=(1.0, 1.0, 1.0)), lambda f: f / 1e5 + 1e-4, 1e-4)
    result = analyze_curve(replace(loop, origin=False))
    assert result.hysteresis is not None
    assert result.hysteresis.area == pytest.approx(80.0 * 1e-4, rel=1e-6)
    assert math.isnan(result.hysteresis.relative)


@pytest.mark.parametrize("bend", [0.0, 0.3])
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_noise_does_not_make_k_larger(share: float, bend: float) -> None:
    """Noise of a tenth and of half the first step: weights that follow it gave 0.3 and 6 % more."""
    force = np.linspace(20.0, 220.0, 11)
    true = force / 95e3 * (1 + bend * force / 220)
    noise = np.full(11, share * true[0])
    rng = np.random.default_rng(1)
    ks = [
        stiffness(LevelTable(force, u, noise / 50, noise, np.full(11, np.nan)), Choice())
        for u in true + noise * rng.standard_normal((2000, 11))
    ]
    error = float(np.mean(ks)) / stiffness(table(force, true), Choice()) - 1
    assert abs(error) < 3 * np.std(ks) / np.mean(ks) / np.sqrt(len(ks)) + 0.05 * share**2


def test_a_curve_is_bent_where_it_leaves_its_line_beyond_the_noise() -> None:
    """Noise is what is stated, or what differs from run to run where that is more."""
    noise = np.random.default_rng(3).normal(0, 1e-5, 15)  # five times what is stated
    points = [
        replace(p, displacement=p.displacement + e)
        for p, e in zip(curve().points, noise, strict=True)
    ]
    assert not analyze_curve(curve()).bent
    assert not analyze_curve(replace(curve(), points=tuple(points))).bent
    assert analyze_curve(curve(lambda f: f / 1e5 + 1e-8 * f**2)).bent
    assert not analyze_curve(curve(lambda f: f / 1e5 + 1e-10 * f**2)).bent  # 1 um: in the noise


def test_a_curve_that_yields_in_its_first_run_only_is_bent() -> None:
    """What has yielded stays: the runs after it are straight again."""
    levels = [10.0 * i for i in range(1, 13)]
    first = curve(lambda f: f / 1e5 + 5e-6 * max(f - 60, 0), levels, factors=(1.0,))
    later = curve(levels=levels)
    points = (*first.points, *(p for p in later.points if p.repetition > 1))
    assert analyze_curve(replace(later, points=points)).bent
