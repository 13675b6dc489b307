"""Repetitions that ended far below the others' largest force: left out, and said why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.curve import Curve, Point
from identification.cut_short import cut_short
from identification.stiffness import analyze_curve
from rig.analysis.analyze import analyze
from rig.dataset import load
from rig.report.wishes import Wishes
from tests.unit.report_sets import Page, bench, rewritten, sketch
from tests.unit.stiffness_tables import run, table

LEVELS = tuple(np.arange(20.0, 221.0, 20.0))


def softening(force: float) -> float:
    """The published curve in x, m: 133 N/mm at zero load, 3.09 mm at 220 N."""
    return force / 133e3 * (1 + force / 256.0)


def curve(counts: Sequence[int], law: Callable[[float], float] = softening) -> Curve:
    """As many levels a repetition as `counts` says."""
    points = [
        Point(r, "loading", step, f, law(f) * (1 + 0.002 * r), 0.1, 2e-6, 5)
        for r, count in enumerate(counts, start=1)
        for step, f in enumerate(LEVELS[:count], start=1)
    ]
    return Curve("P1", "x", (1.0, 0.0, 0.0), tuple(points), 0.0, 0.0)


def changed(c: Curve, repetition: int, **factors: float) -> Curve:
    """One repetition with its force or displacement times a factor."""
    points = [
        replace(p, **{n: getattr(p, n) * f for n, f in factors.items()})
        if p.repetition == repetition
        else p
        for p in c.points
    ]
    return replace(c, points=tuple(points))


def test_it_is_no_part_of_mean_and_scatter_and_says_why() -> None:
    result, whole = analyze_curve(curve((11, 3, 11))), analyze_curve(curve((11, 0, 11)))
    assert result.k == whole.k
    assert result.by_repetition == whole.by_repetition
    assert result.levels == whole.levels
    assert result.pointwise == whole.pointwise
    reason = "repetition 2 ended at 60 of 220 N: left out of the mean"
    assert [(e.step, e.repetition, e.reason) for e in result.excluded] == [
        (step, 2, reason) for step in (1, 2, 3)
    ]
    assert not result.steps_out
    assert not result.counts(2, 3)
    assert result.counts(1, 3)


def test_why_nine_tenths() -> None:
    whole = analyze_curve(curve((11,))).k
    assert whole is not None
    for count, higher in ((10, 0.02), (9, 0.04), (6, 0.11)):
        k = analyze_curve(curve((count,))).k
        assert k is not None
        assert k.value / whole.value - 1 == pytest.approx(higher, abs=0.005)


@pytest.mark.parametrize(("count", "out"), [(10, []), (9, [2]), (1, [2])])
def test_the_limit_lies_at_nine_tenths(count: int, out: list[int]) -> None:
    assert list(cut_short(curve((11, count, 11)))) == out


def test_what_gave_way_further_at_less_force_counts() -> None:
    """Under an imposed displacement a softened specimen reaches it with less force."""
    assert not cut_short(changed(curve((11, 6, 11)), 2, displacement=3.0))
    assert list(cut_short(changed(curve((11, 6, 11)), 2, displacement=1.5))) == [2]


def test_every_level_reached_counts_at_whatever_force() -> None:
    assert not cut_short(changed(curve((11, 11)), 2, force=0.4, displacement=0.3))


def test_a_top_level_that_lost_its_value_was_reached() -> None:
    c = curve((11, 11))
    lost = [
        replace(p, displacement=math.nan) if p.repetition == 2 and p.step > 6 else p
        for p in c.points
    ]
    result = analyze_curve(replace(c, points=tuple(lost)))
    assert [e.step for e in result.excluded] == [7, 8, 9, 10, 11]
    assert len(result.by_repetition) == 2


def test_a_pull_and_a_running_recording() -> None:
    pull = changed(curve((11, 3)), 1, force=-1.0, displacement=-1.0)
    assert list(cut_short(changed(pull, 2, force=-1.0, displacement=-1.0))) == [2]
    assert not cut_short(replace(pull, held=False))
    assert not cut_short(curve(()))


def test_text_and_json() -> None:
    rows = []
    for r, count in enumerate((11, 3, 11), start=1):
        law = [softening, lambda f: 1.002 * softening(f), lambda f: 1.004 * softening(f)][r - 1]
        rows += run(lambda f, law=law: 1e3 * law(f), LEVELS[:count], repetition=r)
    result = analyze(table(rows))
    text = result.to_text()
    assert "2 repetitions: " in text
    assert (
        "Not counted: steps 1, 2, 3: repetition 2 ended at 60 of 220 N: left out of the mean."
    ) in " ".join(text.split())
    entry = result.to_json()["directions"]["x"]
    assert len(entry["by_repetition_N_per_mm"]) == 2
    assert entry["excluded"][0] == {
        "step": 1,
        "reason": "repetition 2 ended at 60 of 220 N: left out of the mean",
        "repetition": 2,
    }


def test_the_report_says_so_too(tmp_path: Path) -> None:
    path = bench(tmp_path / "a.h5")
    data = stopped(path)
    report = sketch([rewritten(path, columns=data)], Wishes(gap=False, made="now"))
    text = Page(report.to_html()).text
    assert "N/mm (repetition 2 not counted in full)" in text
    assert "repetition 2 ended at 40 of 100 N: left out of the mean" in text


def stopped(path: Path) -> dict[str, object]:
    """Of `path`, without what repetition 2 measured above 40 N."""
    columns = load(path).columns
    kept = (columns["repetition"] != 2) | (columns["step"] <= 2)
    return {name: values[kept] for name, values in columns.items()}
