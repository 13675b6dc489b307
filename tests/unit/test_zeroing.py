"""What tells a tare under load: at its limits, and with signals that say nothing."""

from __future__ import annotations

from math import nan

import pytest

from rig.procedure.unloaded import Unloaded
from rig.zeroing import tared_under_load

LOADED = [(20.0, 0.2), (60.0, 0.6)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("after", "told"),
    [
        ((-20.0, -0.2), True),
        ((-20.0, -0.11), True),
        ((-20.0, -0.09), False),
        ((-20.0, -0.41), False),
        ((-20.0, 0.2), False),
        ((-20.0, 0.0), False),
        ((-2.0, -0.02), False),
        ((20.0, 0.2), False),
        ((0.0, -0.2), False),
    ],
)
def test_both_fall_in_the_ratio_of_the_curve(
    after: tuple[float, float], told: bool, sign: float
) -> None:
    loaded = [(f, sign * u) for f, u in LOADED]
    assert tared_under_load((0.0, 0.0), loaded, (after[0], sign * after[1])) is told
    shifted = [(f + 3.0, u + 5.0) for f, u in loaded]
    assert tared_under_load((3.0, 5.0), shifted, (after[0] + 3.0, sign * after[1] + 5.0)) is told


def test_without_a_reading_nothing_is_told() -> None:
    assert not tared_under_load((0.0, 0.0), [], (-20.0, -0.2))
    assert not tared_under_load((0.0, nan), LOADED, (-20.0, -0.2))


@pytest.mark.parametrize("dead", ["force", "laser"])
def test_a_dead_signal_stops_nothing(dead: str) -> None:
    unloaded = Unloaded()
    unloaded.tared(("P1", "x"), 4.5)
    for branch, force, laser in (("zero", 0.0, 4.5), ("loading", 20.0, 4.7), ("zero", 0.0, 4.5)):
        unloaded.row(branch, 0.0 if dead == "force" else force, 4.5 if dead == "laser" else laser)
    assert unloaded.tared_under_load() is None
