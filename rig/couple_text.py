"""The result of `rig couple` in words and tables, with the published numbers beside."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rig.couple import CouplingResult

# J. Manuf. Mater. Process. 2026, 10(2), 54: N/mm along x and y, and what the text derives.
PUBLISHED_SINGLE = (95.94, 57.42)
PUBLISHED_COUPLED = (212.0, 2950.0)
PUBLISHED_GAIN_PERCENT = (200.0, 5940.0)
PUBLISHED_TIMES_Y = 37.19
PUBLISHED_WORKSPACE = (3.50, 1.06, 30.23)  # m^3, m^3, percent


def text(result: CouplingResult) -> str:
    """Everything that a terminal shows."""
    parts = [_stiffness(result), _workspace(result), _decisions(result), _schedule(result)]
    if result.model.arm.name == "ur10e" and abs(result.spec.base_distance - 1.5) < 1e-6:
        parts.append(published())
    parts += [f"Note: {note}" for note in result.notes]
    return "\n\n".join(p for p in parts if p)


def _stiffness(result: CouplingResult) -> str:
    axes = "mirror axes" if result.spec.load_axes == "mirror" else "base axes"
    lines = [
        f"Stiffness in N/mm (standard uncertainty). Single: base axes. Coupled: {axes}, "
        f"beta = {np.rad2deg(result.spec.beta):g} deg; the model's coupling: "
        f"{result.spec.described}.",
        f"  {'':<10} {'x':>18} {'y':>18} {'z':>18}",
    ]
    rows = {"single": (result.single, result.u_single)}
    rows |= {name: (result.pair[name], result.u_pair[name]) for name in result.pair}
    for name, (values, u) in rows.items():
        cells = "".join(
            f" {f'{v / 1e3:.1f} ({s / 1e3:.1f})':>18}" for v, s in zip(values, u, strict=True)
        )
        lines.append(f"  {name:<10}{cells}")
    for name, values in result.pair.items():
        cells = "".join(f" {f'{g:.2f} times':>18}" for g in values / result.single)
        lines.append(f"  gain {name:<5.5}{cells}")
    return "\n".join(lines)


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
            f"  {d.direction}: {d.required / 1e3:g} N/mm required, single {d.single / 1e3:.1f}, "
            f"coupled {d.coupled / 1e3:.1f} -> {d.state}"
        )
    return "\n".join(lines) if result.decisions else ""


def _schedule(result: CouplingResult) -> str:
    if result.schedule is None:
        return ""
    lines = ["Along the path"]
    lines += [f"  {i.start:g} s to {i.end:g} s: {i.state}" for i in result.schedule.intervals()]
    return "\n".join(lines)


def published() -> str:
    """The published numbers, and what follows from them: shown, never judged by."""
    times = [c / s for c, s in zip(PUBLISHED_COUPLED, PUBLISHED_SINGLE, strict=True)]
    volume_single, volume_coupled, percent = PUBLISHED_WORKSPACE
    return "\n".join(
        [
            "Published (doi 10.3390/jmmp10020054), beside what follows from its own numbers",
            f"  single {PUBLISHED_SINGLE[0]}, {PUBLISHED_SINGLE[1]} N/mm; coupled "
            f"{PUBLISHED_COUPLED[0]:g}, {PUBLISHED_COUPLED[1]:g} N/mm along x, y",
            f"  gains stated: +{PUBLISHED_GAIN_PERCENT[0]:g} %, +{PUBLISHED_GAIN_PERCENT[1]:g} % "
            f"and {PUBLISHED_TIMES_Y} times; the stiffnesses give {times[0]:.2f} and "
            f"{times[1]:.1f} times (+{100 * (times[0] - 1):.0f} %, +{100 * (times[1] - 1):.0f} %)",
            f"  workspace stated: {volume_single:.2f} and {volume_coupled:.2f} m^3, {percent} %; "
            f"the half ball of 1.3 m has 4.60 m^3. The definition behind {volume_single:.2f} is "
            "not published",
        ]
    )
