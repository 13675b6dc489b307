"""What is aimed at, beside what was reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Measure:
    """One line of the table: title, place in the summary, and what is aimed at (None: nothing).

    at_least: the figure is to be as large as the target, or as small. A second figure is shown
    beside the first where both belong together.
    """

    title: str
    place: str
    target: float | None = None
    at_least: bool = True
    upper: float | None = None  # for a figure that is to lie between two


@dataclass(frozen=True)
class Line:
    """A measure with its figure; low, high: 95 % interval of a rate; met: None if undecided."""

    measure: Measure
    value: float | None
    low: float | None = None
    high: float | None = None
    hits: int | None = None
    n: int | None = None

    @property
    def met(self) -> bool | None:
        """Whether the figure itself (not its interval) is as good as what is aimed at; of a rate
        over few cases nobody can say."""
        m = self.measure
        if self.value is None or m.target is None or (self.n is not None and self.n < _FEW):
            return None
        if m.upper is not None:
            return m.target <= self.value <= m.upper
        return self.value >= m.target if m.at_least else self.value <= m.target

    @property
    def aim(self) -> str:
        """`>= 0.95`, `<= 0.04`, `0.87 to 0.93` or nothing."""
        m = self.measure
        if m.target is None:
            return ""
        if m.upper is not None:
            return f"{m.target:g} to {m.upper:g}"
        return f"{'>=' if m.at_least else '<='} {m.target:g}"


_FEW = 20  # cases


MEASURES = (
    Measure("one effect: right", "right", 0.95),
    Measure("one effect: right or in the set", "right_or_in_set", 0.98),
    Measure("one effect: exactly the true word", "exact"),
    Measure("everything: right", "right_all_kinds"),
    Measure("wrong with p > 0.9", "confident_errors"),
    Measure("false alarms on none", "false_alarms", 0.01, at_least=False),
    Measure("unknown: recall", "unknown_recall", 0.95),
    Measure("unknown: known effects called so", "known_called_unknown", 0.02, at_least=False),
    Measure("unknown: AUROC", "unknown_auroc", 0.99),
    Measure("two effects: F1", "mixtures.f1", 0.9),
    Measure("two effects: F1, exact words", "mixtures.f1_exact_words"),
    Measure("two effects: verdict right", "mixtures.main_cause_right"),
    Measure("calibration: ECE", "calibration.ece", 0.04, at_least=False),
    Measure("calibration: ECE by chance, mean", "calibration.ece_by_chance.mean"),
    Measure("calibration: ECE by chance, 95 %", "calibration.ece_by_chance.p95"),
    Measure("calibration: Brier, verdict", "calibration.brier_top"),
    Measure("calibration: Brier, all words", "calibration.brier_all_words"),
    Measure("90 % intervals hold the truth", "calibration.coverage_90", 0.87, upper=0.93),
    Measure("95 % intervals hold the truth", "calibration.coverage_95"),
    Measure("where: joint", "where.joint", 0.95),
    Measure("where: joint, with joint readings", "where.joint_with_readings"),
    Measure("where: main direction", "where.main_direction", 0.95),
    Measure("where: same directions", "where.same_directions"),
    Measure("where: encoders see it", "where.encoders"),
    Measure("fitted / noise, median", "gap.fitted_over_noise.median"),
    Measure("fitted / noise, 90th percentile", "gap.fitted_over_noise.p90"),
    Measure("withheld / noise, median", "gap.withheld_over_noise.median", 1.05, at_least=False),
    Measure(
        "withheld / noise, 90th percentile", "gap.withheld_over_noise.p90", 1.3, at_least=False
    ),
    Measure("withheld / fitted, median", "gap.withheld_over_fitted.median", 1.1, at_least=False),
    Measure("withheld / fitted, 90th percentile", "gap.withheld_over_fitted.p90"),
    Measure("gap shrinks by (withheld), median", "gap.shrink_withheld.median"),
    Measure("named effect beats wrong runners-up", "gap.beats_wrong_runners_up"),
    Measure("time a case, median, s", "time.median_s", 2.0, at_least=False),
    Measure("time a case, 95th percentile, s", "time.p95_s", 5.0, at_least=False),
    Measure("crashed, refused or late", "crashed_or_late"),
)


def lines(summary: dict[str, Any]) -> list[Line]:
    """Every measure with its figure, in order."""
    return [_line(measure, summary) for measure in MEASURES]


def _line(measure: Measure, summary: dict[str, Any]) -> Line:
    value: Any = summary
    for key in measure.place.split("."):
        value = value[key]
    if not isinstance(value, dict):
        return Line(measure, value)
    low, high = value["ci95"]
    return Line(measure, value["value"], low, high, value["hits"], value["n"])
