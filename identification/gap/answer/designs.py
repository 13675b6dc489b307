"""Procedures of measurement as they can be planned: the present one, and what could be done next.

A design is what decides over the information in a measurement: setups, levels of load, whether it
unloads, how long it holds and rests, which channels are recorded and how well they are calibrated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from identification.gap.data import LOADING, UNLOADING, ZERO, GapData, Instruments, Setup
from identification.gap.model.bench import Bench
from identification.gap.recording.rows import REST_S
from identification.running import stretches
from identification.times import MOUNT_S, SCREW_S, SETTLE_S, UNLOAD_S

APPROACH_S = SCREW_S + SETTLE_S  # of a level
_MOST_LEVELS = 10
_MOST_A_HOLD = 60  # samples that a plan has: faster ones count as means of several
_WEIGHT_GAIN, _GAUGE_GAIN = 0.01, 0.002  # a known weight, a gauge block: standard uncertainties


@dataclass(frozen=True, eq=False)
class Design:
    """levels: loads N of each setup, rising in size. cycles: largest load of each cycle of a
    repetition, of the last level. both_senses: every cycle also runs against the direction."""

    setups: tuple[Setup, ...]
    levels: tuple[tuple[float, ...], ...]
    repetitions: int
    unload: bool
    both_senses: bool
    cycles: tuple[float, ...]
    hold_s: float
    sample_s: float
    approach_s: float
    zero_s: float
    rest_s: float
    readings: bool
    components: bool
    instruments: Instruments
    output_encoder: bool = True  # whether joint readings, if any, contain the gear's deflection

    @property
    def minutes(self) -> float:
        """Time that hands and clocks take for all of it."""
        holds = sum(len(_pass(self, k)) for k in range(len(self.setups)))
        once = holds * (self.hold_s + self.approach_s) + len(self.setups) * (
            UNLOAD_S + 2 * self.zero_s + self.rest_s
        )
        mounts = MOUNT_S * len(self.setups) if self.setups[0].pose else 0.0
        return (self.repetitions * once + mounts) / 60


@dataclass(frozen=True, eq=False)
class Candidate:
    """A design that could be measured next; kind: a short key, text: what to do and why."""

    kind: str
    text: str
    design: Design


@dataclass(frozen=True, eq=False)
class Elsewhere:
    """Setups that the rig could take up besides the present ones; text says where they are."""

    kind: str
    text: str
    setups: tuple[Setup, ...]


def present_design(bench: Bench) -> Design:
    """The design behind a measurement, as nearly as its rows tell."""
    rows, data = bench.rows, bench.data
    sample = rows.sample_time
    if rows.read_once:  # from level to level, and on the way for a part of it
        sample = max(sample - APPROACH_S, 1.0)
    hold, approach, zero = 5 * sample, APPROACH_S, _zero_s(bench, sample)
    if not rows.continuous:
        hold = float(np.median(rows.hold_weight[~rows.zero])) * sample if ~rows.zero.all() else hold
    else:
        once = max(bench.load_history.session_span / max(len(np.unique(rows.run)), 1), 1e-6)
        hold, approach, zero, sample = once / 20, 0.0, 0.0, once / 100
    thinned = max(1.0, hold / (_MOST_A_HOLD * sample))
    sizes = np.sign(bench.load) * (np.abs(bench.load) > 0.2 * np.abs(bench.load).max())
    return Design(
        setups=data.setups,
        levels=tuple(_levels(bench, s) for s in range(len(data.setups))),
        repetitions=int(np.clip(len(np.unique(rows.repetition)), 1, 3)),
        unload=_unloads(bench),
        both_senses=bool({-1.0, 1.0} <= set(sizes.tolist())),
        cycles=(1.0,),
        hold_s=hold,
        sample_s=thinned * sample,
        approach_s=approach,
        zero_s=zero,
        rest_s=_rest_s(bench),
        readings=bench.has_q,
        components=rows.tangential is not None,
        instruments=_averaging(data.instruments, thinned),
        output_encoder=data.output_encoder,
    )


def _averaging(meter: Instruments, samples: float) -> Instruments:
    """Instruments whose readings are means of as many samples."""
    less = samples**-0.5
    return replace(meter, force=meter.force * less, displacement=meter.displacement * less)


def _unloads(bench: Bench) -> bool:
    """Whether it comes back step by step, not only to zero at once."""
    if bench.rows.continuous:
        return bench.load_history.unloads
    return bool(np.any(bench.rows.branch == UNLOADING))


def _zero_s(bench: Bench, sample: float) -> float:
    rows = bench.rows
    runs = max(len(np.unique(rows.run)), 1)
    return float(rows.weight[rows.zero].sum()) * sample / (2 * runs)


def _rest_s(bench: Bench) -> float:
    starts = np.flatnonzero(bench.rows.starts)[1:]
    if not bench.rows.clock or not starts.size:
        return REST_S
    gaps = bench.rows.session[starts] - bench.rows.session[starts - 1]
    return float(np.clip(np.median(gaps), 0.0, 3600.0))


def _levels(bench: Bench, s: int) -> tuple[float, ...]:
    """Loads of one setup: those of its steps, or even ones up to its largest load."""
    rows = bench.rows
    mine = rows.setup == s
    load = bench.load[mine]
    top = float(load[np.argmax(np.abs(load))]) if load.size else 0.0
    if not rows.continuous:
        steps = rows.step[mine]
        loading = (rows.branch[mine] != UNLOADING) & (steps > 0) & ~rows.in_ramp[mine]
        found = sorted({int(k) for k in steps[loading]})
        means = [float(load[loading & (steps == k)].mean()) for k in found]
        rising = [v for v in means if v * top > 0]
        rising.sort(key=abs)
        if 2 <= len(rising) <= _MOST_LEVELS + 5:
            return tuple(rising)
    return tuple(float(v) for v in np.linspace(0, top, _MOST_LEVELS + 1)[1:])


# --- the path of a design ------------------------------------------------------------------------


def _pass(design: Design, s: int) -> list[tuple[int, int, float]]:
    """Branch, step and load of the holds of one repetition, zero plateaus left out."""
    levels = design.levels[s]
    out: list[tuple[int, int, float]] = []
    for share in design.cycles:
        count = max(1, round(share * len(levels)))
        up = [(LOADING, k + 1, levels[k]) for k in range(count)]
        down = [(UNLOADING, k + 1, levels[k]) for k in range(count - 2, -1, -1)]
        out += up
        if design.unload or len(design.cycles) > 1 or design.both_senses:
            out += down
        if design.both_senses:
            out += [(b, len(levels) + k, -load) for b, k, load in [*up, *down]]
    return out


def planned(design: Design, bench: Bench) -> GapData:
    """The samples of a design on a rig like that of the bench: loads and clocks, and the response
    of the simulated springs in place of measured values."""
    rows = list(_walk(design))
    setup, repetition, branch, step, load, time, session = (
        np.array(c) for c in zip(*rows, strict=True)
    )
    whole, n, data = np.int64, len(rows), bench.data
    setup, repetition = setup.astype(whole), repetition.astype(whole)
    lever = np.stack([s.lever for s in design.setups])[setup]
    outside = np.array([s.outside for s in design.setups])[setup]
    return replace(
        data,
        setups=design.setups,
        time=time,
        session=session,
        run=stretches(setup, repetition),
        setup=setup,
        repetition=repetition,
        branch=branch.astype(whole),
        step=step.astype(whole),
        force=load,
        displacement=(lever**2 @ data.compliance + outside) * load,
        instruments=design.instruments,
        tangential=np.zeros((n, 2)) if design.components else None,
        q=np.zeros((n, data.joints)) if design.readings else None,
        output_encoder=design.output_encoder,
        temperature=None,
        curves=None,
        in_ramp=None,
        onward=None,
        imposed="displacement" if bench.imposed else "force",
    )


def _walk(design: Design) -> Iterator[tuple[float, ...]]:
    """Setup, repetition, branch, step, load, time and session of every sample."""
    now = 0.0
    for s, repetition in product(range(len(design.setups)), range(1, design.repetitions + 1)):
        now += MOUNT_S if s and repetition == 1 else 0.0
        start = now
        for branch, step, load, count in _holds(design, s):
            now += design.approach_s if branch != ZERO else UNLOAD_S
            for _ in range(count):
                now += design.sample_s
                yield s, repetition, branch, step, load, now - start, now
        now += UNLOAD_S + design.rest_s


def _holds(design: Design, s: int) -> list[tuple[int, int, float, int]]:
    """Branch, step, load and samples of every hold of one run of a setup."""
    samples = max(1, round(design.hold_s / design.sample_s))
    zeros = round(design.zero_s / design.sample_s)
    at_rest = [(ZERO, 0, 0.0, zeros)] if zeros else []
    return [*at_rest, *((*at, samples) for at in _pass(design, s)), *at_rest]


# --- what could be done next ---------------------------------------------------------------------


def candidates(design: Design, arm: bool, elsewhere: Sequence[Elsewhere]) -> list[Candidate]:
    """Designs derived from the present one, each with one thing changed."""
    out = [*_channels(design, arm), *_paths(design), *_amplitudes(design, arm)]
    out += _calibrated(design, arm)
    for other in elsewhere:
        added = _with_setups(design, other.setups)
        out.append(Candidate(other.kind, other.text, added))
    return out


def _channels(design: Design, arm: bool) -> Iterator[Candidate]:
    if arm and design.output_encoder and not design.readings:
        yield Candidate(
            "readings",
            "Record the joint positions (output encoders) during the same procedure: what happens "
            "in a joint shows in its reading, what happens elsewhere does not.",
            replace(design, readings=True),
        )
    if arm and not design.components:
        yield Candidate(
            "components",
            "Record all three components of the force: a load that acts askew shows in the other "
            "two.",
            replace(design, components=True),
        )


def _paths(design: Design) -> Iterator[Candidate]:
    if not design.unload:
        yield Candidate(
            "unload",
            "Unload in the same steps and hold at zero load after every run: what comes back is "
            "elastic, what stays is not.",
            replace(design, unload=True, zero_s=max(design.zero_s, 20 * design.sample_s)),
        )
    longer = 6 * max(design.hold_s, 20 * design.sample_s)
    yield Candidate(
        "holds",
        f"Hold every second or third step for {longer:.3g} s, up and down: creep goes on, friction "
        "and lags do not.",
        replace(design, hold_s=longer, unload=True, levels=tuple(_fewer(v) for v in design.levels)),
    )
    plateau = max(60 * design.sample_s, 3 * design.zero_s)
    yield Candidate(
        "plateaus",
        f"Hold at zero load for {plateau:.3g} s before and after every run: what drifts or jumps "
        "without load shows there.",
        replace(design, zero_s=plateau),
    )
    one_way = [s for s in design.setups if not any(_opposite(s, t) for t in design.setups)]
    if one_way:
        yield Candidate(
            "reversed",
            "Load along the opposite sense of every direction as well: thresholds and curves with "
            "a sense, weight and datum behave differently there.",
            _with_setups(design, tuple(reverse(s) for s in one_way)),
        )
    yield Candidate(
        "steps",
        "Repeat with half the step size, up and down: thresholds, corners and curves separate.",
        replace(design, levels=tuple(_finer(v) for v in design.levels), unload=True),
    )


_AMPLITUDES = (0.3, 0.6, 1.0)


def _amplitudes(design: Design, arm: bool) -> Iterator[Candidate]:
    """On an arm every amplitude is a setup of its own, as a protocol wants it: x_30, x_60, x."""
    text = (
        "Run cycles of growing amplitude (30, 60, 100 % of the load), unloading fully in between: "
        "thresholds, loops and curves answer amplitude differently."
    )
    if not arm:
        yield Candidate("cycles", text, replace(design, cycles=_AMPLITUDES, unload=True))
        return
    setups, levels = [], []
    for setup, steps in zip(design.setups, design.levels, strict=True):
        for share in _AMPLITUDES:
            count = max(1, round(share * len(steps)))
            name = setup.direction + (f"_{100 * share:.0f}" if share < 1 else "")
            setups.append(replace(setup, direction=name))
            levels.append(steps[:count])
    grown = replace(design, setups=tuple(setups), levels=tuple(levels), unload=True)
    yield Candidate("cycles", text, grown)


def _calibrated(design: Design, arm: bool) -> Iterator[Candidate]:
    meter = design.instruments
    force, displacement, rig = (
        ("dynamometer", "laser", "arm") if arm else ("force sensor", "displacement sensor", "rig")
    )
    better = [
        f"{check} ({100 * known:g} %; META states {100 * stated:.2g} %)"
        for check, known, stated in (
            (f"a known weight on the {force}", _WEIGHT_GAIN, meter.force_gain),
            (f"a gauge block under the {displacement}", _GAUGE_GAIN, meter.displacement_gain),
        )
        if stated > known
    ]
    if better:
        gains = "gains" if len(better) > 1 else "gain"
        yield Candidate(
            "calibrate",
            f"Check the {gains} before measuring again: {', '.join(better)}, and put what you find "
            f"into META; what then remains is the {rig}'s.",
            replace(
                design,
                instruments=replace(
                    meter,
                    force_gain=min(meter.force_gain, _WEIGHT_GAIN),
                    displacement_gain=min(meter.displacement_gain, _GAUGE_GAIN),
                ),
            ),
        )


def _fewer(levels: tuple[float, ...]) -> tuple[float, ...]:
    """About five of the levels, the last one among them."""
    return levels[:: -max(1, round(len(levels) / 5))][::-1]


def _finer(levels: tuple[float, ...]) -> tuple[float, ...]:
    ends = np.array([0.0, *levels])
    middle = (ends[1:] + ends[:-1]) / 2
    return tuple(
        float(v) for v in np.sort(np.append(levels, middle))[:: 1 if levels[-1] > 0 else -1]
    )


def _with_setups(design: Design, setups: tuple[Setup, ...]) -> Design:
    levels = tuple(_scaled(design, s) for s in setups)
    return replace(design, setups=(*design.setups, *setups), levels=(*design.levels, *levels))


def _scaled(design: Design, setup: Setup) -> tuple[float, ...]:
    """Levels of a new setup: those of the same direction (or of the first) times the ratio of the
    levers, so that the joint that carries most there carries as much as it does now."""
    same = [
        k
        for k, s in enumerate(design.setups)
        if s.direction.lstrip("+-") == setup.direction.lstrip("+-")
    ]
    model = same[0] if same else int(np.argmax([abs(v[-1]) for v in design.levels]))
    before, after = (float(np.abs(s.lever).max()) for s in (design.setups[model], setup))
    factor = float(np.clip(before / max(after, 1e-9), 0.5, 1.5))
    return tuple(v * factor for v in design.levels[model])


def _opposite(a: Setup, b: Setup) -> bool:
    """Whether two setups load one place in opposite senses."""
    return a.pose == b.pose and bool(np.allclose(a.unit_vector, -b.unit_vector, atol=1e-6))


def reverse(setup: Setup) -> Setup:
    """The same place loaded in the opposite sense; lengths and masses stay."""
    name = setup.direction
    return replace(
        setup,
        direction=name[1:] if name.startswith("-") else f"-{name.lstrip('+')}",
        unit_vector=-setup.unit_vector,
        lever=-setup.lever,
        offset_lever=-setup.offset_lever,
        turned_lever=-setup.turned_lever,
        bent_lever=-setup.bent_lever,
        turned_offset=-setup.turned_offset,
        moment=-setup.moment,
    )
