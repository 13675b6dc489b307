"""The result of `rig couple` in words and tables, with the published numbers beside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rig.digits import number
from rig.models.model import told_first
from rig.units import N_PER_MM

if TYPE_CHECKING:
    from rig.coupling.couple import CouplingResult

# J. Manuf. Mater. Process. 2026, 10(2), 54: N/mm along x and y, and what the text derives.
PUBLISHED_SINGLE = (95.94, 57.42)
PUBLISHED_COUPLED = (212.0, 2950.0)
PUBLISHED_GAIN_PERCENT = (200.0, 5940.0)
PUBLISHED_TIMES_Y = 37.19
PUBLISHED_WORKSPACE = (3.50, 1.06, 30.23)  # m^3, m^3, percent
HALF_BALL_M3 = 4.6014  # of the stated reach, 1.300 m: 2/3 pi R^3
INCONSISTENT = (
    "follows: gains from the published stiffnesses, the single workspace from the stated reach of "
    "1.3 m, the ratio from the two stated volumes. The stated gains do not follow from the stated "
    "stiffnesses; the definition behind 3.50 m^3 is not published."
)


def text(result: CouplingResult) -> str:
    """Everything that a terminal shows."""
    first, others = told_first(result.notes)
    parts = [*first, _stiffness(result), _workspace(result), _decisions(result), _schedule(result)]
    if is_published_setup(result):
        parts.append(published(result))
    parts += [f"Note: {note}" for note in others]
    return "\n\n".join(p for p in parts if p)


def is_published_setup(result: CouplingResult) -> bool:
    """Whether the model is of the published arms: two UR10e, 1500 mm apart."""
    return result.model.arm.name == "ur10e" and abs(result.spec.base_distance - 1.5) < 1e-6


def _stiffness(result: CouplingResult) -> str:
    axes = "mirror axes" if result.spec.load_axes == "mirror" else "base axes"
    lines = [
        f"Stiffness in N/mm (standard uncertainty). Single: base axes. Coupled: {axes}, "
        f"beta = {np.rad2deg(result.spec.beta):g} deg; the model's coupling: "
        f"{result.spec.described}.",
        f"  {'':<14} {'x':>18} {'y':>18} {'z':>18}",
    ]
    rows = {"single": (result.single, result.u_single)}
    rows |= {name: (result.pair[name], result.u_pair[name]) for name in result.pair}
    for name, (values, u) in rows.items():
        cells = "".join(
            f" {f'{_tenths(v * N_PER_MM, 1.0)} ({_tenths(s * N_PER_MM)})':>18}"
            for v, s in zip(values, u, strict=True)
        )
        lines.append(f"  {name:<14}{cells}")
    for name, values in result.pair.items():
        cells = "".join(f" {f'{g:.2f} times':>18}" for g in values / result.single)
        lines.append(f"  {f'gain {name}':<14}{cells}")
    return "\n".join(lines)


def _tenths(value: float, from_: float = 0.05) -> str:
    """One digit after the point, or two significant digits below `from_`."""
    return number(value, 2) if 0 < abs(value) < from_ else f"{value:.1f}"


def _workspace(result: CouplingResult) -> str:
    lines = ["Workspace in m^3"]
    for w in result.workspaces:
        lines += [
            f"  single {w.single:.4f}, coupled {w.coupled:.4f}, ratio {100 * w.ratio:.2f} %",
            f"    {w.definition}",
        ]
    return "\n".join(lines)


def _decisions(result: CouplingResult) -> str:
    lines = ["When to couple"]
    for d in result.decisions:
        lines.append(
            f"  {d.direction}: {d.required * N_PER_MM:g} N/mm required, "
            f"single {_tenths(d.single * N_PER_MM, 1.0)}, "
            f"coupled {_tenths(d.coupled * N_PER_MM, 1.0)} -> {d.state}"
        )
    return "\n".join(lines) if result.decisions else ""


def _schedule(result: CouplingResult) -> str:
    if result.schedule is None:
        return ""
    lines = ["Along the path"]
    lines += [f"  {i.start:g} s to {i.end:g} s: {i.state}" for i in result.schedule.intervals()]
    return "\n".join(lines)


@dataclass(frozen=True)
class Beside:
    """One published number: `stated` as printed, `follows` from the paper's other numbers (None:
    nothing does), `model`: ours for the same quantity. `digits` after the point."""

    quantity: str
    unit: str
    stated: float
    follows: float | None
    model: float
    digits: int = 2


def compare(result: CouplingResult) -> list[Beside]:
    """Every published number beside what follows from it and what the model gives.

    Coupled is the rigid pair, as the paper has it. Shown, never judged by.
    """
    rows = []
    pair, single = result.pair["rigid"] * N_PER_MM, result.single * N_PER_MM
    for i, axis in enumerate("xy"):
        stated, coupled = PUBLISHED_SINGLE[i], PUBLISHED_COUPLED[i]
        times = coupled / stated
        gain = float(pair[i] / single[i])
        rows += [
            Beside(f"single {axis}", "N/mm", stated, None, float(single[i])),
            Beside(f"coupled {axis}", "N/mm", coupled, None, float(pair[i]), 1),
            Beside(
                f"gain {axis}",
                "%",
                PUBLISHED_GAIN_PERCENT[i],
                100 * (times - 1),
                100 * (gain - 1),
                0,
            ),
        ]
        if axis == "y":
            rows.append(Beside("gain y", "times", PUBLISHED_TIMES_Y, times, gain))
    space = result.workspaces[0]
    alone, shared, percent = PUBLISHED_WORKSPACE
    ratio = 100 * shared / alone
    return [
        *rows,
        Beside("workspace single", "m^3", alone, HALF_BALL_M3, space.single),
        Beside("workspace coupled", "m^3", shared, None, space.coupled),
        Beside("workspace ratio", "%", percent, ratio, 100 * space.ratio),
    ]


def published(result: CouplingResult) -> str:
    """The comparison as a table, and where the published numbers contradict each other."""
    lines = [
        "Published (doi 10.3390/jmmp10020054) beside this model; shown, never judged by",
        f"  {'':<20}{'stated':>10}{'follows':>10}{'this model':>12}",
    ]
    for row in compare(result):
        follows = "" if row.follows is None else f"{row.follows:.{row.digits}f}"
        lines.append(
            f"  {row.quantity + ', ' + row.unit:<20}{row.stated:>10g}{follows:>10}"
            f"{row.model:>12.{row.digits}f}"
        )
    return "\n".join([*lines, f"  {INCONSISTENT}"])
