"""Which channel was driven, from the data alone: signatures of hand-made rigs, both ways round."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.model.bench import displacement_imposed, make_bench
from identification.gap.recording.imposed import (
    _goes_on,
    _slides,
    displacement_simpler,
)
from identification.gap.recording.pieces import Channel
from tests.conformance.gap_designs import linear
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import running

NOISE = 3e-4  # of the range
N = 1500


def triangle(t: Array, cycles: float) -> Array:
    return np.asarray(2 * np.abs(2 * ((cycles * t + 0.25) % 1) - 1) - 1)


def crank(t: Array, cycles: float) -> Array:
    return np.asarray(np.sin(2 * np.pi * cycles * t))


def slider(u: Array, limit: float) -> Array:
    """Spring of 1 up to a limit of friction."""
    out, state = np.empty_like(u), 0.0
    for i, step in enumerate(np.diff(u, prepend=u[0])):
        state = float(np.clip(state + step, -limit, limit))
        out[i] = state
    return out


def relaxing(t: Array, u: Array) -> Array:
    """Standard solid: half of it fades within a twentieth of the test."""
    slow, dt = np.zeros_like(u), t[1] - t[0]
    for i in range(1, len(u)):
        slow[i] = slow[i - 1] + dt / 0.05 * (u[i - 1] - slow[i - 1])
    return u - 0.5 * slow


def stairs(t: Array, steps: int) -> Array:
    return np.asarray(np.clip((t * steps) % 1 / 0.05, 0, 1) + np.floor(t * steps)) / steps


def rates(t: Array) -> Array:
    """Two cycles each in a twentieth, a fifth and the rest of the test."""
    return triangle(np.interp(t, [0, 0.05, 0.25, 1], [0, 2, 4, 6]), 1)


def by_hand(t: Array) -> Array:
    """No straight lines, no half cosines: harder to follow than the plateaus of what answers."""
    return (0.5 + t) * np.sin(2 * np.pi * (2 * t + 0.5 * t**2)) + 0.05 * np.sin(37 * t)


def play(u: Array) -> Array:
    return u - np.clip(u, -0.3, 0.3)


def wall(t: Array) -> Array:
    """Three cycles each of ten sizes."""
    return np.asarray(np.floor(1 + 10 * t) / 10 * np.sin(2 * np.pi * 30 * t))


def worn(u: Array) -> Array:
    """Bears where it was last pushed to, on either side, with a texture of the place."""
    out = np.zeros_like(u)
    for sign in (1.0, -1.0):
        pushed = sign * u
        out += sign * np.maximum(pushed - np.maximum.accumulate(np.maximum(pushed - 0.2, 0)), 0)
    return out * (1 + 0.1 * np.sin(40 * u))


# name -> (path, answer): what answers follows from what is driven
RIGS: dict[str, Callable[[Array], tuple[Array, Array]]] = {
    "friction, triangles": lambda t: (triangle(t, 6), slider(triangle(t, 6), 0.2)),
    "friction, crank": lambda t: (crank(t, 6), slider(crank(t, 6), 0.2)),
    "growing cycles": lambda t: ((1 + t) * crank(t, 8), slider((1 + t) * crank(t, 8), 0.4)),
    "yield in one pull": lambda t: (t, np.minimum(t, 0.3 + 0.1 * t)),
    "cubic, crank": lambda t: (crank(t, 3), crank(t, 3) ** 3),
    "nearly straight, crank": lambda t: (crank(t, 3), crank(t, 3) + 0.03 * crank(t, 3) ** 3),
    "play, triangles": lambda t: (triangle(t, 5), play(triangle(t, 5))),
    "ramps and holds": lambda t: (stairs(t, 3), relaxing(t, stairs(t, 3))),
    "held from the start": lambda t: (np.ones_like(t), 0.5 + 0.5 * np.exp(-t / 0.1)),
    "friction, by hand": lambda t: (by_hand(t), slider(by_hand(t), 0.1)),
    "worn, thirty cycles": lambda t: (wall(t), worn(wall(t))),
    "rates far apart": lambda t: (rates(t), relaxing(t, rates(t))),
}


def measured(name: str, by_force: bool, n: int = N, seed: int = 1, unit: float = 1.0) -> GapData:
    t = np.arange(n) / n
    driven, answer = RIGS[name](t)
    rng = np.random.default_rng(seed)
    driven = driven + NOISE * rng.standard_normal(n)
    answer = answer + NOISE * rng.standard_normal(n)
    force, moved = (driven, answer) if by_force else (answer, driven)
    data = bench_data(
        unit * 8.0 * force,
        2**-10 * moved,
        time=t,
        session=t,
        step=np.full(n, -1),
        branch=np.full(n, 3),
        run=np.zeros(n, dtype=np.int64),
        repetition=np.ones(n, dtype=np.int64),
    )
    known = replace(data.instruments, force=unit * 8.0 * NOISE, displacement=2**-10 * NOISE)
    return replace(data, instruments=known)


@pytest.mark.parametrize("by_force", [False, True], ids=["displacement", "force"])
@pytest.mark.parametrize("name", RIGS)
def test_what_follows_lines_and_cosines_is_driven(name: str, by_force: bool) -> None:
    assert displacement_imposed(measured(name, by_force)) is not by_force


@pytest.mark.parametrize("name", RIGS)
def test_neither_units_nor_sizes_nor_misjudged_noise_decide(name: str) -> None:
    for unit in (2.0**-30, 2.0**20):
        assert displacement_simpler(measured(name, False, unit=unit))
    data = measured(name, False)
    for factor in (0.5, 2.0):
        judged = replace(data.instruments, force=data.instruments.force * factor)
        assert displacement_simpler(replace(data, instruments=judged))


def test_noise_of_the_driven_channel_is_no_answer() -> None:
    """A weak curve over a crank that is read thirty times worse than the force."""
    data = measured("nearly straight, crank", by_force=False)
    rough = data.displacement + 2**-10 * 30 * NOISE * np.random.default_rng(2).standard_normal(N)
    known = replace(data.instruments, displacement=2**-10 * 30 * NOISE)
    assert displacement_simpler(replace(data, displacement=rough, instruments=known))


def test_a_reading_that_wanders_within_its_noise_stands_still() -> None:
    data = measured("held from the start", by_force=False)
    wander = np.cumsum(np.random.default_rng(5).standard_normal(N))
    held = 1 + NOISE * (wander - wander.mean()) / wander.std()
    assert displacement_simpler(replace(data, displacement=2**-10 * held))


def test_the_clock_may_be_missing_or_start_anew_with_every_run() -> None:
    data = measured("friction, crank", by_force=False)
    number = np.arange(N, dtype=float)
    assert displacement_simpler(replace(data, time=number, session=None))
    assert displacement_simpler(replace(data, time=-number, session=-number))  # no clock at all


def test_samples_that_were_not_kept_leave_gaps_on_the_clock_of_every_run() -> None:
    data = measured("cubic, crank", by_force=False)
    run = np.minimum(np.arange(N) * 3 // N, 2).astype(np.int64)
    kept = np.random.default_rng(6).random(N) < 0.15
    kept[np.searchsorted(run, [0, 1, 2])] = True
    anew = np.arange(N) - np.searchsorted(run, run)
    few = {
        k: v[kept]
        for k, v in {
            "step": data.step,
            "branch": data.branch,
            "run": run,
            "repetition": run + 1,
            "time": 1.0 * anew,
        }.items()
    }
    data = replace(
        bench_data(data.force[kept], data.displacement[kept], **few), instruments=data.instruments
    )
    assert displacement_simpler(data)


def test_a_long_recording_with_short_ramps_shows_them() -> None:
    """Ramps of one thousandth: bins of equal time would lose them."""
    t = np.arange(60_000) / 60_000
    u = np.clip((t - 0.1) / 1e-3, 0, 1) + np.clip((t - 0.5) / 1e-3, 0, 1)
    data = measured("cubic, crank", by_force=False, n=len(t))
    noise = 3e-4 * np.random.default_rng(3).standard_normal((2, len(t)))
    force, moved = 8.0 * (relaxing(t, u) + noise[0]), 2**-10 * (u + noise[1])
    assert displacement_simpler(replace(data, force=force, displacement=moved))


def test_outliers_of_a_reading_are_its_own() -> None:
    """A spring whose force is read in bursts: the noise of a loose plug follows no driven path."""
    data = measured("cubic, crank", by_force=False)
    plain = data.displacement / 2**-10
    bursts = np.where(np.arange(N) % 200 < 20, np.random.default_rng(4).standard_normal(N), 0.0)
    assert displacement_simpler(replace(data, force=8.0 * (plain + 0.4 * bursts)))
    turned = replace(data, displacement=2**-10 * (plain + 0.4 * bursts), force=8.0 * plain)
    assert not displacement_simpler(turned)


def test_what_does_not_tell_is_force() -> None:
    """A straight spring; nothing that moves at all; a standing force under a target that drifts."""
    data = measured("cubic, crank", by_force=False)
    line = triangle(np.arange(N) / N, 4)
    assert not displacement_simpler(replace(data, force=line, displacement=1e-3 * line))
    still = np.zeros(N)
    assert not displacement_simpler(replace(data, force=still, displacement=still))
    assert not displacement_simpler(replace(data, force=still, displacement=1e-3 * line**2))
    few = bench_data(line[:10], np.abs(line[:10]), step=np.full(10, -1))
    assert not displacement_simpler(few)


def test_what_is_stated_counts() -> None:
    data = measured("friction, crank", by_force=False)
    assert not displacement_imposed(replace(data, imposed="force"))
    turned = measured("friction, crank", by_force=True)
    assert displacement_imposed(replace(turned, imposed="displacement"))


def damper(t: Array) -> tuple[Array, Array]:
    """Growing strokes, and a force with the sense of motion: round plateaus, easy to follow."""
    u = (0.4 + t) * np.sin(2 * np.pi * 2.4 * t**0.9)
    v = np.gradient(u, t)
    return u, np.tanh(4 * v / np.abs(v).max())


def weight_on_and_off(t: Array) -> tuple[Array, Array]:
    """Creep under a weight, and recovery: the force stands, the displacement goes on."""
    force = np.where(t < 0.5, 1.0, 0.0)
    return force, 1e-2 * force + np.where(t < 0.5, 1.0 - np.exp(-t / 0.1), np.exp((0.5 - t) / 0.1))


@pytest.mark.parametrize(
    ("rig", "costs", "driven"),
    [
        (damper, (-6.5, -4.9), True),
        (damper, (-8.0, -4.9), False),
        (lambda t: (triangle(t, 3), triangle(t, 3) ** 3), (-5.0, -4.9), False),
    ],
    ids=["slides", "slides, but the force is far simpler", "springs"],
)
def test_of_two_paths_about_as_simple_a_rig_that_slides_drove_its_stroke(
    rig: Callable[[Array], tuple[Array, Array]],
    costs: tuple[float, float],
    driven: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(RIGS, "mine", rig)
    data = measured("mine", by_force=False, n=200)
    left = iter(costs)
    monkeypatch.setattr("identification.gap.recording.imposed.cost", lambda *_: next(left))
    assert displacement_simpler(data) is driven


def test_creep_under_a_weight_is_no_sliding() -> None:
    t = np.arange(400) / 400
    force, moved = weight_on_and_off(t)
    data = bench_data(8.0 * force, 2**-10 * moved, time=t, session=t, step=np.full(400, -1))
    known = replace(data.instruments, force=8e-4, displacement=1e-7)
    assert not displacement_simpler(replace(data, instruments=known))


def test_what_toggles_between_two_steps_of_its_scale_does_not_slide_to_and_fro() -> None:
    """A speed, counted coarsely, behind a step of the voltage, which stands."""
    t = np.arange(120) * 0.01
    force = np.where(t > 0.2, 1.0, 0.0)
    speed = np.round((1 - np.exp(-np.maximum(t - 0.2, 0) / 0.12)) * 15) / 15
    toggles = np.where(np.arange(120) % 2, 1 / 15, 0.0) * (t > 0.5)
    still, moved = Channel(t, force, 0.0), Channel(t, speed + toggles, 0.03)
    assert not _slides(still, moved)
    there = Channel(t, np.where(t < 0.6, t, 1.2 - t) / 0.6, 0.03)
    rubs = Channel(t, np.where(t < 0.6, 1.0, -1.0), 0.0)
    assert _slides(rubs, there)


def test_noise_of_a_displacement_is_no_sliding_and_no_standing() -> None:
    """A straight pull, the extensometer scatters by an eighth of its range, half of what is stated
    beside: it moves all the same, and goes nowhere to and fro."""
    t, ramp = np.arange(184.0), np.linspace(0.0, 1.0, 184)
    u = ramp + 0.12 * np.random.default_rng(2).standard_normal(184)
    data = bench_data(7e3 * ramp, 6e-5 * u, time=t, session=t, step=np.full(184, -1))
    meter = replace(data.instruments, force=30.0, displacement=0.55 * 6e-5 * float(np.std(u)))
    assert not displacement_simpler(replace(data, instruments=meter))
    held = replace(data, displacement=6e-5 * (u - ramp), instruments=meter)
    assert displacement_simpler(held)  # that one stands
    assert not _slides(Channel(t, ramp, 0.0), Channel(t, u, 0.12))


@pytest.mark.parametrize("noise", [0.012, 0.2])
def test_a_spring_that_is_read_in_noise_does_not_slide(noise: float) -> None:
    time, there = np.arange(1000.0), 1 - np.abs(np.arange(1000) / 500 - 1)  # and back
    u = there + noise * np.random.default_rng(4).standard_normal(1000)
    assert not _slides(Channel(time, there, 0.0), Channel(time, u, noise))


def test_strokes_slide_however_finely_they_are_read_in_noise() -> None:
    u = 0.5 - 0.5 * np.cos(np.arange(1000) / 80)
    rubs = 0.4 * np.sign(np.gradient(u)) + 0.5
    noisy = u + 0.02 * np.random.default_rng(8).standard_normal(1000)
    time = np.arange(1000.0)
    assert _slides(Channel(time, rubs, 0.001), Channel(time, noisy, 0.02))


def test_what_rings_under_a_force_that_stands_does_not_slide() -> None:
    """A target on a soft post, after every step of a weight."""
    t = np.arange(1600) * 0.05
    step = (t // 10).astype(int)
    force = np.array([0.0, 1.0, 2.0, 1.0, 3.0, 0.0, 2.0, 1.0])[step]
    jump = np.diff(np.array([0.0, 0.0, 1.0, 2.0, 1.0, 3.0, 0.0, 2.0, 1.0]))[step]
    since = t % 10
    moved = force - jump * np.exp(-since / 8) * np.cos(2 * np.pi * 0.9 * since)
    assert not _slides(Channel(t, force / 3, 1e-3), Channel(t, moved / np.ptp(moved), 1e-3))
    data = bench_data(100 * force, 1e-3 * moved, time=t, session=t, step=np.full(1600, -1))
    known = replace(data.instruments, force=0.1, displacement=1e-6)
    assert not displacement_simpler(replace(data, instruments=known))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("rubs", [0.0, 0.03])
def test_a_play_that_is_driven_through_slides(rubs: float, sign: float) -> None:
    """No force on the way, there or back, and all of it at its ends; gauges of either sign."""
    t = np.arange(1200.0)
    u = np.sin(2 * np.pi * t / 200) + 0.05 * np.sin(2 * np.pi * t / 37)
    force = 20 * (u - np.clip(u, -0.95, 0.95)) + rubs * np.sign(np.gradient(u))
    scaled = sign * force / np.ptp(force)
    assert _slides(Channel(t, scaled, 1e-3), Channel(t, u / np.ptp(u), 1e-3))


@pytest.mark.slow
def test_an_arm_that_is_read_at_rest_answers_the_force_that_was_read() -> None:
    """Whatever its screw holds: the displacement is linear in what the springs give way."""
    data = replace(arm_data(), imposed="displacement")
    assert not displacement_imposed(data)
    assert any("at rest the joints bear the force" in n for n in explained(data).notes)
    assert displacement_imposed(replace(data, step=np.full(len(data.step), -1)))


@pytest.mark.slow
def test_what_is_held_at_no_displacement_may_still_be_pulled() -> None:
    """A tip that is gripped, and a joint that has slipped: no amplifier drifts there."""
    data = arm_data()
    assert make_bench(data).has_zero_force
    gripped = replace(data, imposed="displacement")
    assert not make_bench(gripped).has_zero_force
    late = (data.step == 0) & (data.time > data.time.mean())
    pulled = np.where(late, -5.0, data.force)
    moved = np.where(late, data.displacement - 5.0 * 1.1e-5, data.displacement)
    found = explained(replace(gripped, force=pulled, displacement=moved))
    assert "force_drift" not in [e.name for e in found.effects]


@pytest.mark.slow
@pytest.mark.parametrize(("times", "verdict"), [(1.0, "none"), (6.0, "unknown")])
def test_an_arm_whose_readings_scatter_more_than_stated_is_not_explained(
    times: float, verdict: str
) -> None:
    """A neighbour's machine, sampled too seldom to be seen as a vibration."""
    data = linear("rich")
    shaken = np.random.default_rng(8).normal(0, (times**2 - 1) ** 0.5, len(data.force))
    sd = data.instruments.displacement
    found = explained(replace(data, displacement=data.displacement + sd * shaken))
    assert found.verdict == verdict
    noted = [n for n in found.notes if "6 times as much as stated" in n]
    assert bool(noted) == found.bench.noise.misjudged == (verdict == "unknown")


def test_a_ramp_is_no_vibration() -> None:
    """An arm whose load runs has no holds about which it could swing."""
    data = arm_data()
    ramp = np.abs(1 - (2 * data.time / data.time.max()) % 2)
    runs_on = replace(
        data, step=np.full(len(data.step), -1), force=160 * ramp, displacement=160 * 1.1e-5 * ramp
    )
    noise = make_bench(runs_on).noise
    assert noise.swings == 0
    assert not noise.misjudged


@pytest.mark.parametrize("by_force", [True, False])
def test_what_turns_where_it_turned_before_is_driven(by_force: bool) -> None:
    """Pulses and cycles, while the other channel wanders or grows weaker: by its path alone one
    looks as driven as the other."""
    t = np.arange(1200)
    pulses = 50 * np.clip(1.5 * np.sin(2 * np.pi * t / 120), 0.0, 1.0)
    wanders = 12 * np.sin(2 * np.pi * t / 700) + 6 * np.sin(2 * np.pi * t / 410)
    rng = np.random.default_rng(8)
    driven = pulses + rng.normal(0, 0.05, 1200)
    answers = pulses + wanders + rng.normal(0, 0.4, 1200)
    force, moved = (driven, answers) if by_force else (answers, driven)
    data = running(force, 1e-5 * moved)
    assert displacement_simpler(data) is not by_force


@pytest.mark.parametrize("most", [2.0, 4.0, 12.0])
def test_strokes_that_grow_were_driven_against_what_yields(most: float) -> None:
    """Three cycles each, from 1.3 times the stroke at which it yields: the force turns where it
    yields, every time."""
    cycles = np.repeat(np.linspace(1.3, most, 4), 3)
    t = np.arange(12 * 100)
    stroke = cycles[t // 100] * triangle(t / 100, 1)
    rng = np.random.default_rng(10)
    force = slider(stroke, 1.0) + rng.normal(0, 1e-3, len(t))
    assert displacement_simpler(running(force * 100, 1e-3 * stroke))


def test_a_rig_that_slides_at_one_force_was_not_driven_by_it() -> None:
    """Strokes that grow turn elsewhere each time, and the force at what the seal holds."""
    t = np.linspace(0.0, 1.0, 1200)
    stroke = (0.4 + 0.6 * t) * triangle(t, 8)
    rng = np.random.default_rng(9)
    force = slider(stroke, 0.05) + rng.normal(0, 2e-4, 1200)
    assert displacement_simpler(running(force * 100, 1e-3 * stroke))


def necked() -> GapData:
    """A bar with an extensometer: up its elastic part evenly, which takes half of the readings, on
    a plateau, up again, and down beyond the neck."""
    s = np.linspace(0.0, 1.0, 200)
    moved = np.where(s < 0.5, 0.01 * s, 0.005 + 4.0 * (s - 0.5) ** 2)
    force = np.interp(s, [0, 0.5, 0.51, 0.6, 0.85, 1.0], [0, 0.65, 0.6, 0.62, 1.0, 0.86])
    rng = np.random.default_rng(5)
    return bench_data(
        8.0 * (force + 1e-3 * rng.standard_normal(200)),
        2**-10 * (moved + 1e-3 * rng.standard_normal(200)),
        time=200 * s,
        session=200 * s,
        step=np.full(200, -1),
        branch=np.full(200, 3),
        run=np.zeros(200, dtype=np.int64),
        repetition=np.ones(200, dtype=np.int64),
    )


def test_a_pull_that_goes_on_while_its_force_falls_was_no_force_that_was_set() -> None:
    data = necked()
    assert displacement_imposed(data)
    force, moved = data.force, data.displacement
    assert _goes_on(force, moved, 0.01)
    assert not _goes_on(np.minimum(force, 0.9 * force.max()), moved, 0.01)  # a twentieth lower
    assert not _goes_on(force, moved, 0.2)  # that may be noise
    assert not _goes_on(force, np.minimum(moved, moved[170]), 0.01)  # nothing goes on
    there_and_back = np.concatenate([moved, moved[::-1]])
    assert not _goes_on(np.concatenate([force, force[::-1]]), there_and_back, 0.01)
