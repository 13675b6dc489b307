"""Parts that let go of the rig on the way back: what the stroke does then is not done to them."""

from __future__ import annotations

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData, Instruments
from identification.gap.recording.lost_contact import without_lost_contact
from tests.explained import explained
from tests.unit.test_gap_running import SPRING, running, triangle

METER = Instruments(0.1, 1e-6, 0.005, 0.003)
STROKE = 1e-3


def pressed(force: Array, path: Array, seed: int = 3, **changes: object) -> GapData:
    rng = np.random.default_rng(seed)
    n = len(force)
    given = {"imposed": "displacement", "instruments": METER} | changes
    return running(force + rng.normal(0, METER.force, n), path + rng.normal(0, 1e-7, n), **given)


def strokes(n: int = 600, cycles: float = 4.0) -> Array:
    return STROKE * triangle(n, cycles)


def relaxes(path: Array, time_s: float = 60.0, share: float = 0.5) -> Array:
    """Force of a standard solid, which may pull."""
    slow, out = 0.0, np.empty(len(path))
    for i, u in enumerate(path):
        slow += (u - slow) / time_s
        out[i] = SPRING * (u - share * slow)
    return out


def test_a_part_that_relaxes_and_lets_go_creeps() -> None:
    """Held at both ends it would pull; let go it does nothing until it is met again."""
    path = strokes()
    pulls = relaxes(path)
    assert pulls.min() < -5
    held, free = pressed(pulls, path), pressed(np.maximum(pulls, 0.0), path)
    assert without_lost_contact(held) is held
    kept = without_lost_contact(free)
    gone = len(free.force) - len(kept.force)
    assert gone == pytest.approx(np.sum(pulls < -1.0), rel=0.2)
    assert kept.aside[-1].startswith("The part lets go of the rig before the stroke is back")
    assert f"{gone} readings" in kept.aside[-1]
    assert explained(free).verdict == "joint_creep"


def test_what_is_met_and_let_go_at_one_place_stays() -> None:
    """Lost motion, and a toe: their way without force is the same every time."""
    path = strokes()
    for force in (
        SPRING * np.maximum(path - 0.3 * STROKE, 0.0),
        SPRING * STROKE * (path / STROKE) ** 4,
    ):
        data = pressed(force, path)
        assert without_lost_contact(data) is data


def test_what_has_yielded_is_let_go_where_it_yielded_to() -> None:
    """The last way back is set aside to its end, the others but for where the part is met anew."""
    path = strokes(cycles=2.0)
    top = np.maximum.accumulate(path)
    force = np.maximum(SPRING * (path - np.maximum(top - 0.4 * STROKE, 0.0)), 0.0)
    data = pressed(force, path)
    kept = without_lost_contact(data)
    assert len(kept.force) < 0.8 * len(data.force)
    assert kept.force[-1] < 5
    assert kept.displacement[-1] > 0.5 * STROKE
    assert kept.displacement[kept.time > 150].min() > 0.5 * STROKE


def test_a_force_that_is_lost_on_the_way_in_breaks_or_snaps() -> None:
    """What happens to the part before the stroke turns is done to it."""
    path = strokes()
    at = path / STROKE
    snaps = np.where(at < 0.3, at / 0.3, np.where(at < 0.5, 0.0, 1.2 * (at - 0.5) / 0.5))
    breaks = np.where(at < 0.6, at, 0.0)
    assert without_lost_contact(pressed(100 * snaps, path)).lets_go is False
    pull = slice(0, 75)
    assert without_lost_contact(pressed(100 * breaks[pull], path[pull])).lets_go is False


@pytest.mark.parametrize(
    ("cycles", "time_s"),
    [
        pytest.param(2, 60.0, marks=pytest.mark.slow),
        (4, 60.0),
        pytest.param(4, 20.0, marks=pytest.mark.slow),
        (6, 60.0),
    ],
)
def test_what_lets_go_is_no_lag(cycles: int, time_s: float) -> None:
    """Strokes of a crank; nobody says which channel it drives."""
    path = STROKE * (1 - np.cos(2 * np.pi * cycles * np.arange(600) / 600)) / 2
    for imposed in ("displacement", None):
        data = pressed(np.maximum(relaxes(path, time_s), 0.0), path, imposed=imposed)
        kept = without_lost_contact(data)
        assert kept.lets_go
        assert kept.imposed == "displacement"
    found = explained(data)
    assert found.bench.imposed
    assert found.verdict in ("joint_creep", "joint_hysteresis", "unknown")
    assert found.probabilities["time_lag"] < 0.05


def test_a_stroke_that_nothing_bears_and_one_that_starts_pressed_stay() -> None:
    """A dry run shows noise alone; a first reading without force may be the only one."""
    path = strokes()
    for force in (np.zeros(len(path)), np.where(np.arange(len(path)) == 1, 50.0, 0.0)):
        for u in (path, STROKE - path):
            data = pressed(force, u)
            assert len(without_lost_contact(data).force) >= len(path) // 2
    loud = Instruments(30.0, 1e-6, 0.005, 0.003)
    assert without_lost_contact(pressed(np.zeros(600), path, instruments=loud)).lets_go is False


def test_readings_are_counted_where_there_is_no_clock() -> None:
    path = strokes()
    data = pressed(np.maximum(relaxes(path), 0.0), path, timed=False)
    assert "(at reading " in without_lost_contact(data).aside[-1]


def test_only_where_the_stroke_is_imposed() -> None:
    path = strokes()
    force = np.maximum(relaxes(path), 0.0)
    for data in (pressed(force, path, imposed="force"), pressed(force[:15], path[:15])):
        assert without_lost_contact(data) is data
