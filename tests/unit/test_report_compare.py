"""Whether two data sets differ: the test against other implementations, and how often it errs."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from identification.estimate import Choice
from identification.stiffness import Stiffness
from identification.uncertainty import Contribution, Quantity, combined
from rig.analysis.analyze import analyze
from rig.dataset import Dataset, load
from rig.report.compare import Pair, adjusted, aligned, paired, probability, same_instruments
from rig.report.figures import compared_curves
from rig.report.wishes import Wishes
from tests.unit.report_sets import Page, bench, linear, rewritten, sketch

CHOICE = Choice("proportional", intercept=False)
DEVICES = {
    "dynamometer": {"serial_number": "711", "model": "Kistler 9257B", "full_scale_N": "x 500"},
    "laser": {"serial_number": "42", "range_mm": "10"},
}


def side(each: list[float], gain: float = 0.0) -> Stiffness:
    """Repetitions' k in N/mm, and the standard uncertainty of a gain, relative."""
    values = 1e3 * np.array(each)
    k = float(values.mean())
    scatter = float(values.std(ddof=1)) / math.sqrt(len(each))
    budget = (
        Contribution("scatter", "A", scatter, len(each) - 1.0),
        Contribution("gain of the force", "B", gain * k, common=True),
    )
    found = Stiffness("ok", "", CHOICE, "", k=combined(k, budget), budget=budget)
    return replace(found, by_repetition=tuple(values))


def pair(a: Stiffness, b: Stiffness, *, shared: bool = False) -> Pair:
    return paired(1, "x", a, b, shared=shared)


def test_without_gains_it_is_welchs_test() -> None:
    a, b = [95.1, 95.9, 94.8], [97.0, 97.9, 99.1, 96.5]
    welch: Any = stats.ttest_ind(b, a, equal_var=False)
    found = pair(side(a), side(b))
    assert found.p == pytest.approx(float(welch.pvalue), rel=1e-9)
    low, high = welch.confidence_interval(0.95)
    assert found.difference.interval == pytest.approx((1e3 * low, 1e3 * high), rel=1e-6)


def test_gains_of_the_same_instruments_cancel_and_of_others_add() -> None:
    a, b = side([95.0, 95.2, 94.8], 0.005), side([97.0, 97.2, 96.8], 0.005)
    same, other = pair(a, b, shared=True), pair(a, b)
    assert same.p < 0.001 < other.p
    expected = math.hypot(0.005 * 95, 0.005 * 97, 0.2 / math.sqrt(3), 0.2 / math.sqrt(3))
    assert other.difference.u == pytest.approx(1e3 * expected, rel=1e-9)
    assert same.ratio.value == other.ratio.value == pytest.approx(97 / 95)
    assert same.ratio.u < 0.3 * other.ratio.u


def test_three_repetitions_each_and_no_difference_rarely_alarm() -> None:
    """At most 5 % of false alarms; the interval covers in at least 95 %."""
    rng = np.random.default_rng(11)
    draws = rng.normal(95.0, 0.8, (3000, 2, 3))
    found = [pair(side(list(a)), side(list(b))) for a, b in draws]
    alarms = np.mean([p.p < 0.05 for p in found])
    covered = np.mean([p.difference.interval[0] <= 0 <= p.difference.interval[1] for p in found])
    assert 0.02 < alarms < 0.055
    assert covered == pytest.approx(1 - alarms, abs=1e-9)


def test_a_real_difference_is_seen() -> None:
    rng = np.random.default_rng(12)
    draws = rng.normal(0.0, 0.5, (300, 2, 3)) + np.array([95.0, 100.0])[None, :, None]
    seen = np.mean([pair(side(list(a)), side(list(b))).p < 0.05 for a, b in draws])
    assert seen > 0.95


def test_several_comparisons_are_adjusted_after_holm() -> None:
    quantity = Quantity(1.0, 1.0, math.inf, (0.0, 2.0))
    made = [Pair(i, "x", quantity, quantity, p, p, ()) for i, p in enumerate((0.04, 0.01, 0.03))]
    found = [p.adjusted for p in adjusted(made)]
    assert found == pytest.approx([0.06, 0.03, 0.06])
    assert [p.differs for p in adjusted(made)] == [False, True, False]


def test_probability_at_its_limits() -> None:
    assert probability(Quantity(0.0, 0.0, math.inf, (0, 0))) == 1.0
    assert probability(Quantity(1.0, 0.0, math.inf, (1, 1))) == 0.0
    normal = probability(Quantity(1.96, 1.0, math.inf, (0, 0)))
    assert normal == pytest.approx(0.05, abs=1e-4)
    assert probability(Quantity(-1.96, 1.0, 1e9, (0, 0))) == pytest.approx(normal, rel=1e-6)


def test_instruments_are_the_same_only_if_they_say_so(tmp_path: Path) -> None:
    bare = load(bench(tmp_path / "a.h5"))
    assert not same_instruments(bare, bare)

    def with_devices(**changes: str) -> Dataset:
        laser = {**DEVICES["laser"], **changes}
        return replace(bare, devices={**DEVICES, "laser": laser})

    assert same_instruments(with_devices(), with_devices())
    assert not same_instruments(with_devices(), with_devices(serial_number="43"))
    assert not same_instruments(with_devices(), with_devices(range_mm="50"))
    none = with_devices(serial_number="none")
    assert not same_instruments(none, none)


def test_the_page_tells_a_softer_bench(tmp_path: Path) -> None:
    paths = [
        rewritten(bench(tmp_path / f"{name}.h5", linear(k), comment=name), devices=DEVICES)
        for name, k in (("before", 80.0), ("after", 70.0), ("again", 80.0))
    ]
    report = sketch(paths, Wishes(gap=False))
    first, second = report.to_json()["comparison"]
    assert (first["differs"], second["differs"]) == (True, False)
    assert first["difference_N_per_mm"]["value"] == pytest.approx(-10.0, abs=0.05)
    assert first["ratio"]["value"] == pytest.approx(70 / 80, rel=1e-3)
    assert first["same_instruments"]
    text = Page(report.to_html()).text
    assert (
        "Direction x: after.h5 is softer, 0.8750 times as stiff as before.h5 (95 %: 0.8661" in text
    )
    assert "Direction x: no difference is shown; again.h5 is 1.000 times as stiff as" in text
    assert "✗ differs" in text
    assert "○ no difference shown" in text
    assert "the gains cancel, since the instruments are the same" in text


def test_unlike_things_are_remarked(tmp_path: Path) -> None:
    wide = bench(tmp_path / "wide.h5")
    narrow = bench(tmp_path / "narrow.h5", forces=(10.0, 20.0, 30.0))
    (found,) = sketch([wide, narrow], Wishes(gap=False)).to_json()["comparison"]
    assert found["remarks"] == ["they rest on other ranges of force (20 to 100 N; 10 to 30 N)"]


def bent(force: float, r: int) -> float:
    """A spring that softens, and scatters a little between the repetitions."""
    return force / 133.0 * (1 + force / 256.0) * (1 + 0.001 * (r - 2))


FEW, MANY = (20.0, 40.0, 60.0, 80.0), tuple(20.0 * n for n in range(1, 12))


def compared(tmp_path: Path, few: tuple[float, ...], scale: float = 1.0) -> tuple[Any, str]:
    """JSON and text of a report on one softening spring over many levels, and over a few."""
    long = rewritten(bench(tmp_path / "long.h5", bent, forces=MANY), devices=DEVICES)
    law = lambda f, r: scale * bent(f, r)  # noqa: E731
    short = bench(tmp_path / "short.h5", law, forces=few, comment="short")
    report = sketch([long, rewritten(short, devices=DEVICES)], Wishes(gap=False))
    return report.to_json(), Page(report.to_html()).text


def test_bent_curves_are_compared_over_the_levels_that_both_have(tmp_path: Path) -> None:
    found, text = compared(tmp_path, FEW)
    k = [d["analyze"]["directions"]["x"]["stiffness_N_per_mm"] for d in found["datasets"]]
    assert k[1]["value"] > 1.1 * k[0]["value"]  # the averages differ, the springs do not
    (pair,) = found["comparison"]
    assert (pair["differs"], pair["force_N"]) == (False, [20.0, 80.0])
    assert pair["ratio"]["value"] == pytest.approx(1.0, abs=1e-9)
    assert pair["remarks"] == [
        "compared over the 4 levels that both have: the curve is bent, and the k above rest on "
        "other levels (20 to 220 N; 20 to 80 N)"
    ]
    told = "Direction x, from 20.0 to 80.0 N: no difference is shown; short.h5 is 1.000 times"
    assert told in text


def test_a_softer_bent_spring_is_still_told(tmp_path: Path) -> None:
    found, text = compared(tmp_path, FEW, 1.1)
    (pair,) = found["comparison"]
    assert pair["ratio"]["value"] == pytest.approx(1 / 1.1, rel=1e-5)
    assert "Direction x, from 20.0 to 80.0 N: short.h5 is softer, 0.9091 times" in text


def test_levels_within_one_range_count_too(tmp_path: Path) -> None:
    found, _ = compared(tmp_path, (20.0, 200.0, 220.0))
    assert found["comparison"][0]["ratio"]["value"] == pytest.approx(1.0, abs=1e-9)


def test_bent_curves_without_common_levels_are_not_compared(tmp_path: Path) -> None:
    found, text = compared(tmp_path, (10.0, 30.0, 50.0, 60.0))
    assert found["comparison"] == []
    reason = (
        "the curve is bent, so k is an average over its levels, and of these the two have 1 level "
        "in common (20 to 220 N; 10 to 60 N). Measure both at the same levels"
    )
    entry = {"first": 0, "second": 1, "direction": "x", "reason": reason}
    assert found["not_compared"] == [entry]
    assert f"Direction x: short.h5 and long.h5 are not compared: {reason}." in text
    assert "No pose and direction has a stiffness" not in text


def test_nothing_to_compare(tmp_path: Path) -> None:
    zero = bench(tmp_path / "zero.h5", lambda f, r: 0.001 * r, forces=(0.0, 0.0))
    report = sketch([bench(tmp_path / "a.h5"), zero], Wishes(gap=False))
    assert report.to_json()["comparison"] == []
    assert "No pose and direction has a stiffness in the first" in Page(report.to_html()).text


def test_the_same_pose_and_direction_are_one_under_any_name() -> None:
    def named(**poses: str) -> Any:
        parts = {key.replace("_", "/"): pose.split() for key, pose in poses.items()}
        found = {k: SimpleNamespace(pose=p, direction=d) for k, (p, d) in parts.items()}
        return SimpleNamespace(directions=found)

    one, two = named(x="P1 x", y="P1 y"), named(P1_x="P1 x", P2_x="P2 x")
    assert aligned([one, two]) == {"x": ["x", "P1/x"], "y": ["y", None], "P2/x": [None, "P2/x"]}
    assert aligned([two, one]) == {"P1/x": ["P1/x", "x"], "P2/x": ["P2/x", None], "y": [None, "y"]}
    elsewhere = named(x="Q x")  # poses by other names
    assert aligned([one, elsewhere]) == {"x": ["x", "x"], "y": ["y", None]}
    assert aligned([]) == {}


def test_of_curves_over_each_other_the_lower_one_stays_visible(tmp_path: Path) -> None:
    sets = [(name, analyze(load(bench(tmp_path / name)))) for name in ("a.h5", "b.h5")]
    axes = compared_curves("x", ["x", "x"], sets, ()).axes[0]
    lines = [c.lines[0] for c in axes.containers]
    assert [line.get_markerfacecolor() for line in lines] == ["none", "none"]
    assert lines[0].get_markersize() > lines[1].get_markersize() + 2
