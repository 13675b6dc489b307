"""Small data sets for the tests of reduction and analysis: columns, and just enough around them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

Row = tuple[float, str, str, int, str, int, float, float]
NAMES = (
    "time_s",
    "pose",
    "direction",
    "repetition",
    "branch",
    "step",
    "force_N",
    "displacement_mm",
)


def meta(directions: Sequence[str] = ("x", "y"), datum: str = "setup") -> Any:
    force = SimpleNamespace(standard_uncertainty_N=0.1, gain_relative_sd=0.005)
    laser = SimpleNamespace(standard_uncertainty_mm=0.002, gain_relative_sd=0.003)
    return SimpleNamespace(
        directions=dict.fromkeys(directions, (1.0, 0.0, 0.0)),
        instruments=SimpleNamespace(force=force, displacement=laser),
        datum=datum,
        robot="none",
        poses={},
        simulation=None,
    )


@dataclass
class Table:
    """Stands in for a data set."""

    columns: dict[str, Any]
    meta: Any = field(default_factory=meta)
    uuid: str = "00000000-0000-4000-8000-000000000000"
    path: Path | None = Path("run.h5")
    origin: str = "measured"
    complete: bool = True
    lines: tuple[str, ...] = ()
    events: list[dict[str, Any]] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)

    @property
    def used(self) -> Any:
        return ~self.columns["discarded"]

    def banners(self) -> tuple[str, ...]:
        return self.lines


def table(rows: Sequence[Row], **more: Any) -> Table:
    columns = {name: np.array([row[i] for row in rows]) for i, name in enumerate(NAMES)}
    columns["step"] = columns["step"].astype(np.int64)
    columns["discarded"] = np.zeros(len(rows), dtype=bool)
    return Table(columns, **more)


def run(
    law_mm: Callable[[float], float],
    levels: Sequence[float],
    *,
    pose: str = "P1",
    direction: str = "x",
    repetition: int = 1,
    samples: int = 4,
    zero_N: Callable[[float], float] = lambda _: 0.0,
    datum_mm: float = 0.0,
    zeros: tuple[int, int] = (4, 4),
) -> list[Row]:
    """One loading run, a sample a second; `zero_N`: what the amplifier shows without load."""
    rows: list[Row] = []

    def hold(branch: str, step: int, force: float, displacement: float, n: int) -> None:
        for _ in range(n):
            t = float(len(rows))
            rows.append(
                (
                    t,
                    pose,
                    direction,
                    repetition,
                    branch,
                    step,
                    force + zero_N(t),
                    displacement + datum_mm,
                )
            )

    hold("zero", 0, 0.0, 0.0, zeros[0])
    for step, force in enumerate(levels, start=1):
        hold("loading", step, force, law_mm(force), samples)
    hold("zero", 0, 0.0, 0.0, zeros[1])
    return rows
