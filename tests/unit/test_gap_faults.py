"""Faults of an instrument: readings in spells, a displacement that stands still under more load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData, Instruments
from identification.gap.model.bench import make_bench
from identification.gap.recording.faults import (
    SIGNS,
    bursts,
    found_in,
    frozen_since,
    goes_against,
    goes_back,
    jumps_to,
    saturates,
    silent,
)
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_levels import creeping, one_hold
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running


def told(data: GapData) -> tuple[str, ...]:
    """What is said of every fault."""
    return tuple(f.text for f in found_in(data))


def test_creep_of_a_hold_is_no_burst_and_bursts_are() -> None:
    t, u = creeping()
    given = one_hold(t, u)
    assert not bursts(bench_data(given.pop("force"), given.pop("displacement"), **given))
    shaken = u + np.where(np.arange(len(u)) % 11 == 5, 4e-5, 0.0)
    given = one_hold(t, shaken)
    rung = bench_data(given.pop("force"), given.pop("displacement"), **given)
    assert bursts(rung)
    assert "See to the displacement sensor's mounting" in " ".join(told(rung))
    assert "See to the laser's mounting" in " ".join(told(replace(rung, arm=True)))


def test_a_lag_that_takes_half_a_hold_is_no_burst() -> None:
    """A moving average catches up in one sample, three after the load has changed."""
    step = np.repeat(np.arange(40), 10)
    late = np.tile(np.where(np.arange(10) < 4, 0.3, 1.0), 40)
    data = bench_data(20.0 * step, 2e-4 * (step - 1 + late), step=step)
    assert not bursts(data)


def test_what_comes_late_all_the_time_is_no_burst() -> None:
    """A reading that is late by more than half of the shorter holds, up and down again; spells of
    the same size are none the less."""
    length = np.where(np.arange(80) % 3 == 0, 5, 14)
    step = np.repeat(np.arange(80), length)
    up = np.concatenate([np.arange(1, 41), np.arange(39, -1, -1)])
    level, way = up[step], np.diff(up, prepend=0)[step]
    within = np.arange(len(step)) - np.flatnonzero(np.diff(step, prepend=-1))[step]
    late = np.array([0.0, 0.3, 0.8, *np.ones(11)])[within]
    branch = np.where(step < 40, 1, 2)
    u = 2e-4 * (level - way * (1 - late))
    assert not bursts(bench_data(20.0 * level, u, step=step, branch=branch))
    shaken = 2e-4 * level + 4e-5 * ((within == 2) & (length[step] == 5)) * (-1.0) ** (step // 3)
    assert bursts(bench_data(20.0 * level, shaken, step=step, branch=branch))


def test_a_hand_that_trembles_is_no_burst() -> None:
    """What the displacement does the force does as well, now and then."""
    step = np.repeat(np.arange(40), 10)
    rng = np.random.default_rng(4)
    shaken = np.where(rng.random(400) < 0.06, rng.normal(0, 8.0, 400), 0.0)
    force = 20.0 * step + shaken
    u = force / SPRING + rng.normal(0, 1e-6, 400)
    assert not bursts(bench_data(force, u, step=step))
    assert bursts(bench_data(20.0 * step, u, step=step))  # the laser alone


def test_a_line_read_at_odd_times_is_no_burst() -> None:
    steps = np.where(np.arange(200) % 20 == 7, 30.0, 1.0)
    t = np.concatenate([[0.0], np.cumsum(steps)])
    given = one_hold(t, 5e-6 * t)
    assert not bursts(bench_data(given.pop("force"), given.pop("displacement"), **given))


def lost_target(at: int = 60, back: float = 3e-5, n: int = 160) -> tuple[Array, Array]:
    """Force N and displacement m: pulled on and on, the reading jumps back and stays there."""
    force = np.linspace(0.0, 100.0, n)
    u = force / SPRING + np.random.default_rng(3).normal(0, 1e-6, n)
    u[at:] = u[at - 1] - back
    return force, u


def test_a_reading_that_stands_still_under_more_load_than_ever_is_a_fault() -> None:
    force, u = lost_target()
    data = running(force, u, imposed="displacement")  # creep, if that were possible
    assert frozen_since(data) == 60.0
    found = explained(data)
    assert found.verdict == "unknown"
    assert any("lost its target" in note for note in found.notes)


@pytest.mark.parametrize("what", ["relaxes", "stop", "coarse", "short"])
def test_what_stands_still_for_a_reason_is_none(what: str) -> None:
    force, u = lost_target()
    if what == "relaxes":  # the stroke is held, the force goes down
        force = np.append(force[:60], force[59] * np.exp(-np.arange(100) / 50))
    elif what == "stop":  # a hard stop, at the largest displacement of all
        u[60:] = u[:60].max()
    elif what == "coarse":  # as far back as noise goes
        u[60:] = u[:60].max() - 5e-6
    else:  # it goes on after nine readings
        force, u = lost_target(at=12, n=40)
        u[21:] = force[21:] / SPRING
    assert frozen_since(running(force, u)) is None
    assert found_in(running(force, u)) == ()


@pytest.mark.slow
def test_a_laser_that_says_nothing_while_the_load_goes_is_a_fault() -> None:
    """Of an arm in one direction: it is not connected, or looks past the target."""
    given = arm_data()
    mine = np.array([s.direction == "x" for s in given.setups])[given.setup]
    noise = np.random.default_rng(1).normal(0, given.instruments.displacement, len(mine))
    data = replace(given, displacement=np.where(mine, noise, given.displacement))
    assert silent(data, "displacement") == ("P1/x", "P2/x")
    found = explained(data)
    assert found.verdict == "unknown"
    assert found.looks_like is None
    (note,) = (n for n in found.notes if "does not answer" in n)
    assert "The displacement does not answer the force (P1/x, P2/x)" in note


@pytest.mark.parametrize("n", [100, 200_000])
@pytest.mark.parametrize("times", [1.0, 1.5])
def test_nothing_answers_a_stroke_of_a_bench(n: int, times: float) -> None:
    noise = np.random.default_rng(2).normal(0, 0.1 * times, n)
    empty = running(noise, np.linspace(0, 1e-3, n), imposed="displacement")
    assert silent(empty, "force") == ("x",)
    assert "whether anything bears at all" in " ".join(told(empty))


def test_nothing_answers_the_levels_of_a_load() -> None:
    noise = np.random.default_rng(2).normal(0, 1e-6, 100)
    for step, imposed, quiet in (
        (np.arange(100) // 30, None, ("x",)),
        (np.zeros(100), None, ()),
        (np.zeros(100), "force", ("x",)),
    ):
        data = bench_data(np.linspace(0, 200, 100), noise, step=step.astype(int), imposed=imposed)
        assert silent(data, "displacement") == quiet


@pytest.mark.parametrize("what", ["drifts", "in steps", "soft", "cautious", "weak", "little"])
def test_what_answers_little_for_a_reason_is_no_silent_channel(what: str) -> None:
    noise = np.random.default_rng(2).normal(0, 0.02, 100)
    stroke = np.linspace(0, 1e-3, 100)
    data = running(noise, stroke, imposed="displacement")
    assert silent(data, "force") == ("x",)
    loud = replace(data.instruments, force=0.02)
    if what == "drifts":  # at rest, and nobody says who drives
        data = running(noise, stroke)
    elif what == "in steps":  # the same, with numbers
        data = bench_data(noise, stroke, step=np.arange(100) // 20)
    elif what == "soft":  # thirty times softer than simulated
        data = replace(data, force=noise + stroke / 1e-5 / 30)
    elif what == "cautious":  # a hundred times, by a cell that is better than stated
        stated = replace(data.instruments, force=0.5)
        data = replace(data, force=noise + stroke / 1e-5 / 100, instruments=stated)
    elif what == "weak":  # next to nothing, but beyond the noise
        data = replace(data, instruments=loud, force=2.5 * noise)
    else:  # readings of nothing, to the last digit
        data = replace(data, displacement=5e-3 * stroke, force=np.zeros(100))
    assert silent(data, "force") == ()
    assert silent(data, "displacement") == ()


PRECISE = Instruments(0.1, 1e-7, 0.005, 0.003)


def misread(**changes: object) -> GapData:
    """Weights put on and taken off; the dial is misread by a whole turn at one of them, twice."""
    force = np.concatenate([np.arange(10.0), np.arange(9.0, -1.0, -1.0)])
    u = force / SPRING
    u[[6, 7]] -= 3e-5
    step = np.concatenate([np.arange(10), np.arange(20, 10, -1)])
    branch = np.repeat([1, 2], 10)
    given: dict[str, object] = {"displacement": u, "step": step, "branch": branch}
    return bench_data(force, **(given | changes))  # type: ignore[arg-type]


def test_a_displacement_that_goes_back_under_more_force_was_misread() -> None:
    assert goes_back(misread()) == 6
    found = explained(misread())
    assert found.verdict == "unknown"
    (note,) = (n for n in found.notes if "misread" in n)
    assert "At 6 N the displacement goes back, from 0.05 to 0.03 mm" in note
    one = misread()
    force, u = (np.concatenate([v, v]) for v in (one.force, one.displacement))
    u[:20] = force[:20] / SPRING
    run, step = np.repeat([0, 1], 20), np.arange(40)
    assert goes_back(bench_data(force, u, run=run, step=step)) == 26


def recovering() -> GapData:
    """A stroke is held, let go and held again; the force relaxes, and recovers."""
    step = np.repeat([0, 1, 2, 3], [4, 40, 1, 40])
    relaxes, recovers = 15 + 5 * np.exp(-np.arange(40) / 4), 9 - 12 * np.exp(-np.arange(40) / 4)
    force = np.concatenate([np.zeros(4), relaxes, [2.0], recovers])
    u = np.array([0.0, 3e-4, 2e-4, 1e-4])[step]
    return bench_data(force, u, step=step, branch=np.ones(85, dtype=np.int64))


@pytest.mark.parametrize(
    "what",
    [
        "fine",
        "coarse",
        "small",
        "other sense",
        "through zero",
        "unloading",
        "next run",
        "late",
        "datum",
        "recovers",
    ],
)
def test_what_goes_back_for_a_reason_was_not(what: str) -> None:
    data = misread()
    force, u, run = data.force, data.force / SPRING, data.run
    if what == "coarse":  # within ten standard uncertainties, whatever the share
        data = misread(instruments=Instruments(0.1, 4e-6, 0.005, 0.003))
        assert goes_back(data) is None
        return
    if what == "other sense":
        force, u = -force, -u
    elif what == "small":  # a twentieth of the range, far beyond the noise
        u[6] = u[5] - 5e-6
        assert goes_back(misread(displacement=u, instruments=PRECISE)) is None
        return
    elif what == "through zero":  # friction holds it back
        force = np.concatenate([np.linspace(-5, 6, 4), np.linspace(6, 7, 16)])
        u = np.concatenate([[-5e-5, -5e-5, -5e-5, 2e-5], np.linspace(2e-5, 3e-5, 16)])
    elif what == "unloading":  # it creeps on while the load comes off
        u[10:] = u[9] + 4e-6 * np.arange(10)
    elif what == "late":
        u[10] = 6.5 / SPRING
    elif what == "datum":  # far off, as after a jump between two runs
        u = u - 4e-4
    elif what == "next run":  # the datum is another one
        run = np.repeat([0, 1], 10)
        force = np.tile(np.arange(1.0, 11.0), 2)
        u = force / SPRING - 5e-4 * run
    step, branch = np.arange(20), np.ones(20, dtype=np.int64)
    if what == "recovers":  # of a stroke that is held and let go, read once on the way
        assert goes_back(recovering()) is None
        return
    if what == "late":  # it is let go, and the force still shows the last step
        force[10], branch[10:] = 9.6, 2
    assert goes_back(bench_data(force, u, step=step, branch=branch, run=run)) is None


def dropping_out(n: int = 90, every: int = 6) -> tuple[Array, Array]:
    """Force N, displacement m: three loads, of whose readings some are one and the same number."""
    force = np.repeat([10.0, 20.0, 60.0], n // 3)
    u = force / SPRING + np.random.default_rng(4).normal(0, 1e-7, n)
    u[every // 2 :: every] = 4e-4
    return force, u


def test_a_number_to_which_readings_jump_again_and_again_is_no_reading() -> None:
    force, u = dropping_out()
    data = bench_data(force, u, step=np.repeat([1, 2, 3], 30))
    assert jumps_to(data) == 4e-4
    found = explained(data)
    assert found.verdict == "unknown"
    assert any("jumps to one and the same number, 0.4 mm" in note for note in found.notes)
    assert jumps_to(running(force, u)) == 4e-4


@pytest.mark.parametrize(
    "what", ["seldom", "cycles", "digits", "passed", "other numbers", "runs", "twice"]
)
def test_a_number_that_is_met_again_for_a_reason_is_one(what: str) -> None:
    force, u = dropping_out(every=29 if what == "seldom" else 6)
    if what == "cycles":  # the load comes and goes, and a coarse sensor reads the same each time
        force, u = np.where(u == 4e-4, 60.0, force), np.where(u == 4e-4, 4e-4, 1e-4)
    elif what == "digits":  # within ten standard uncertainties, and a tenth of the range
        u = np.where(u == 4e-4, force / SPRING + 6e-6, u)
        u[u == force / SPRING + 6e-6] = np.round(u[u == force / SPRING + 6e-6], 5)
    elif what == "passed":  # on the way from one side to the other
        force = np.full(90, 10.0)
        u = np.tile([0.0, 4e-4, 8e-4, 8.1e-4, 4e-4, 1e-5], 15)
        u = np.where(u == 4e-4, u, u + 1e-8 * np.arange(90))
    elif what == "other numbers":
        u = u + np.where(u == 4e-4, 1e-9 * np.arange(90), 0.0)
    elif what == "runs":  # each begins with the number that it was zeroed to
        force, u = np.full(90, 10.0), 1e-4 + 1e-8 * np.arange(90)
        u[::6] = 4e-4
    elif what == "twice":  # for a while: something else, and not again and again
        force, u = np.full(90, 10.0), 1e-4 + 1e-8 * np.arange(90)
        u[20:30] = u[60:70] = 4e-4
    run = np.arange(90) // 6 if what == "runs" else np.zeros(90, dtype=np.int64)
    assert jumps_to(bench_data(force, u, step=np.arange(90), run=run)) is None


def test_a_force_that_stays_from_step_to_step_while_all_goes_on_is_an_amplifier_that_is_full() -> (
    None
):
    data = arm_data()
    assert saturates(data) is None
    full = replace(data, force=np.minimum(data.force, 85.0))  # of steps of 40 N: 80, 85, 85
    assert saturates(full) == pytest.approx(85.0)
    (note,) = told(full)
    assert "stays at 85 N" in note
    pulled = replace(full, force=-full.force, displacement=-full.displacement)
    assert saturates(pulled) == pytest.approx(-85.0)
    still = np.where(full.step > 3, full.displacement[full.step == 3].mean(), full.displacement)
    assert saturates(replace(full, displacement=still)) is None  # nothing was turned on
    top = replace(data, force=np.where(data.step == 4, 121.0, data.force))
    assert saturates(top) is None  # a last step of 1 N was asked for
    assert saturates(replace(data, force=1e-3 * data.force)) is None  # kN: finer than stated
    assert saturates(replace(full, arm=False)) is None  # a specimen may flow


def test_channels_that_count_in_opposite_senses_are_told_where_they_do() -> None:
    data = arm_data()
    assert goes_against(data) == ()
    everywhere = replace(data, displacement=-data.displacement)
    assert goes_against(everywhere) == ("P1/x", "P1/y", "P2/x", "P2/y")
    one = replace(data, displacement=np.where(data.setup == 1, -1, 1) * data.displacement)
    assert goes_against(one) == ("P1/y",)
    course = make_bench(everywhere).load_history
    (fault,) = course.faults
    assert fault.kind == SIGNS  # and not that it goes back, as it does all the time
    assert goes_back(everywhere) is not None
    assert "P2/y" in fault.text
    assert found_in(everywhere) == (fault,)
    assert course.faults is course.faults  # looked for once


@pytest.mark.slow
def test_channels_that_count_in_opposite_senses_are_no_effect() -> None:
    data = arm_data()
    found = explained(replace(data, displacement=-data.displacement))
    assert (found.verdict, found.looks_like) == ("unknown", None)


def test_what_gives_way_ever_more_has_its_signs_as_they_are() -> None:
    """The end of a record, after the largest force; the whole of it is no case either."""
    u = np.linspace(0.0, 1e-3, 200)
    force = 100 * np.minimum(u / 2e-4, np.exp(-(u - 2e-4) / 4e-4))
    assert goes_against(running(force[40:], u[40:])) == ()
    assert goes_against(running(force, u)) == ()
    assert goes_against(running(-force[40:], u[40:])) == ()
