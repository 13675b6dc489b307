"""What to measure next, as a protocol file that `rig check` and `rig measure` take."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from identification.gap.answer.designs import Design
from identification.gap.answer.discriminate import NextMeasurement
from rig.dataset import Dataset
from rig.diagnosis.diagnose import Diagnosis
from rig.diagnosis.other_setups import other_poses
from rig.errors import InputError
from rig.meta import Meta
from rig.models.robot import load_robot
from rig.plan import plan
from rig.protocol import MeasurementProtocol, parse_protocol
from rig.protocol_before import limits_before, protocol_before
from rig.protocol_write import limit_lines, numbers, pose_line, settle_lines
from rig.protocolfile import ForceBand
from rig.station import load_station
from rig.storage.files import in_place_of
from rig.units import MM_PER_M

_LASER_MM = 9.0  # of a range of 10 mm
_GENTLER = 0.7  # loads times this, where arm, laser or dynamometer could not take them
_TRIES = 4
# Where loading ends, of the displacement that is allowed: no later than all levels take.
_USUAL_STOP, _LATEST_STOP = 0.8, 0.95
_MARGIN = 1.15  # over what is expected: what flows goes far for a few percent of load
# No hand holds less: a screw of 0.5 mm a turn that is set to 1 deg brings an arm of 100 N/mm to
# 0.14 N, and what the dynamometer shows is known to about 0.1 N.
_HOLDABLE_N = 0.2
_APART = 2.5  # half widths: the bands of two levels may not meet
_USUAL = ForceBand(absolute_N=0.5, relative=0.01)


def write_next(diagnosis: Diagnosis, dataset: Dataset, path: Path) -> str:
    """Writes the proposed procedure; what to tell the user. Without a proposal nothing is written,
    and the text says why. InputError for a rig without an arm, or if the folder refuses."""
    check_arm(dataset)
    proposal = diagnosis.result.next_measurement
    if proposal is None:
        return (
            f"{path}: not written. No two effects are left that a measurement is expected to "
            "separate."
        )
    if proposal.design is None:
        return f"{path}: not written. {proposal.text}"
    text = next_text(proposal, dataset)
    with in_place_of(path) as temporary:
        temporary.write_text(text, "utf-8")
    return f"{path}: written. Next: rig check {path}"


def check_arm(dataset: Dataset) -> None:
    """Before the diagnosis; InputError where no protocol can come of it."""
    if dataset.meta.robot == "none":
        raise InputError(
            f"{dataset.path or 'data set'}: robot: none. A protocol file is for an arm; leave "
            "--next out, and the diagnosis itself says what to measure next."
        )


def next_text(proposal: NextMeasurement, dataset: Dataset) -> str:
    """The protocol file. Loads are lowered until arm, laser and dynamometer can take them."""
    old = protocol_before(dataset)
    assert proposal.design is not None
    most = _LATEST_STOP * _displacement_mm(old)
    design, stops = _seen_to_the_end(proposal.design, proposal.reached, most)
    design = _as_aimed_at(design, old)
    station = "emulated" if dataset.origin == "emulated" else old.station if old else "ur10e_lab"
    for _ in range(_TRIES):
        design = _apart(design)
        text = "\n".join(_lines(proposal, design, stops, dataset, old, station)) + "\n"
        try:
            plan(parse_protocol(text, Path("next.yaml")), load_station(station))
        except InputError as error:
            refusal = error
            levels = tuple(tuple(_GENTLER * f for f in one) for one in design.levels)
            design = replace(design, levels=levels)
        else:
            return text
    raise InputError(f"The proposed procedure can't be carried out: {refusal}")


def _seen_to_the_end(
    design: Design, reached: tuple[tuple[float, ...], ...], most_mm: float
) -> tuple[Design, tuple[float, ...]]:
    """The design without levels at which the target goes further than may be seen, and where in mm
    loading ends in each setup: beyond all others, since what flows on the way to a level that is
    never held is in no row. reached: m, of every level; nothing is known of it where it is empty.
    The lowest level stays in any case."""
    usual = _USUAL_STOP / _LATEST_STOP * most_mm
    if not reached:
        return design, tuple(usual for _ in design.setups)
    levels, stops = [], []
    for loads, far in zip(design.levels, reached, strict=True):
        needed = [_MARGIN * m * MM_PER_M for m in far]
        count = max(1, sum(mm <= most_mm for mm in needed))
        levels.append(loads[:count])
        stops.append(min(max(usual, needed[count - 1]), most_mm))
    return replace(design, levels=tuple(levels)), tuple(stops)


def _as_aimed_at(design: Design, old: MeasurementProtocol | None) -> Design:
    """Hands stop short of a level: loads near one that the old protocol wanted are that one."""
    if old is None:
        return design
    wanted = {(run.pose, run.direction): np.array(run.forces_N) for run in old.runs}
    levels = []
    for setup, loads in zip(design.setups, design.levels, strict=True):
        targets = wanted.get((setup.pose, setup.direction))
        if targets is None:
            levels.append(loads)
            continue
        nearest = [float(targets[np.argmin(np.abs(targets - f))]) for f in loads]
        near = all(abs(a - f) < 0.5 + 0.02 * a for a, f in zip(nearest, loads, strict=True))
        rising = all(b > a for a, b in pairwise(nearest))
        levels.append(tuple(nearest) if near and rising else loads)
    return replace(design, levels=tuple(levels))


def _apart(design: Design) -> Design:
    """Without levels that a hand can't set apart from the next higher one, or from no load."""
    least, levels = _APART * _HOLDABLE_N, []
    for loads in design.levels:
        kept = [loads[-1]]
        for load in reversed(loads[:-1]):
            if abs(kept[-1]) - abs(load) > least and abs(load) > least:
                kept.append(load)
        levels.append(tuple(reversed(kept)))
    return replace(design, levels=tuple(levels))


def _lines(
    proposal: NextMeasurement,
    design: Design,
    stops: tuple[float, ...],
    dataset: Dataset,
    old: MeasurementProtocol | None,
    station: str,
) -> Iterator[str]:
    one, other = proposal.separates
    yield from (
        f"# {line}" for line in textwrap.wrap(f"To tell {one} from {other}. {proposal.text}", 96)
    )
    for banner in dataset.banners():
        yield f"# Derived from data that are {banner}"
    meta = dataset.meta
    yield "schema: rig.protocol/1"
    yield f"title: {json.dumps(f'To tell {one} from {other}')}"
    yield f"station: {station}"
    yield f"\nrobot: {meta.robot}"
    yield "poses:"
    yield from _poses(design, meta)
    yield "move_arm: false"
    yield f"joint_encoder: {meta.joint_encoder}"
    yield "\ndirections:"
    vectors = {s.direction: s.unit_vector for s in design.setups}
    for name, vector in vectors.items():
        sign = _sense(design, name)
        yield f"  {json.dumps(name)}: [{numbers(sign * vector, 9)}]"
    yield "\nruns:"
    for setup, levels, stop in zip(design.setups, design.levels, stops, strict=True):
        yield (
            f"  - {{pose: {setup.pose}, direction: {json.dumps(setup.direction)}, "
            f"steps_N: [{numbers(np.abs(levels), 3)}], stop_at_displacement_mm: {stop:.3g}}}"
        )
    yield f"repetitions: {design.repetitions}"
    yield f"branches: {'loading-unloading' if design.unload else 'loading'}"
    yield "order: by_run"
    yield from _timing(design, old, proposal.present)
    top = max(abs(f) for one in design.levels for f in one)
    yield ""
    yield from limit_lines(top, _LASER_MM, limits_before([dataset]))
    if old is not None and (words := old.prompts.get("before_run")):
        yield f"\nprompts: {{before_run: {json.dumps(words)}}}"


def _sense(design: Design, direction: str) -> float:
    """-1 where the loads count against the direction: the screw only pushes."""
    for setup, levels in zip(design.setups, design.levels, strict=True):
        if setup.direction == direction:
            return -1.0 if levels[-1] < 0 else 1.0
    return 1.0


def _poses(design: Design, meta: Meta) -> Iterator[str]:
    known = {name: np.array(p.q_rad) for name, p in meta.poses.items()}
    tcp = {name: p.tcp_xyz_mm for name, p in meta.poses.items()}
    first = design.setups[0].pose
    for name, (_, q) in other_poses(load_robot(meta.robot), meta, first).items():
        known.setdefault(name, q)
        tcp.setdefault(name, tcp[first])
    for name in dict.fromkeys(s.pose for s in design.setups):
        yield pose_line(name, known[name], tcp[name])


def _timing(
    design: Design, old: MeasurementProtocol | None, present: Design | None
) -> Iterator[str]:
    """Times of the design; those of the old protocol, where the design has what was measured
    (present): slots that were late or missed make other ones of them."""
    rate = _rate_Hz(design, old)
    band = _force_band(design)
    samples = max(1, min(5, round(design.hold_s * rate)))
    hold = design.hold_s if design.hold_s * rate > samples else 0.0
    zero = max(design.zero_s, 6.0, 1 / rate)
    before, after, rest = zero, zero, min(design.rest_s, 3600)
    if old is not None and present is not None:
        if design.hold_s == present.hold_s:
            samples, hold = old.sampling.samples_per_step, old.hold_s
        if design.zero_s == present.zero_s:
            before, after = old.zero.before_s, old.zero.after_s
        if design.rest_s == present.rest_s:
            rest = old.rest_s
    yield f"\nsampling: {{rate_Hz: {rate:g}, samples_per_step: {samples}}}"
    yield f"hold_s: {_seconds(hold)}"
    yield f"force_band: {{absolute_N: {band.absolute_N:.3g}, relative: {band.relative:.3g}}}"
    yield from settle_lines(old.settle) if old else settle_lines()
    yield f"step_deadline_s: {old.step_deadline_s if old else 300:g}"
    yield f"zero: {{before_s: {_seconds(before)}, after_s: {_seconds(after)}}}"
    yield f"rest_s: {_seconds(rest)}"
    yield "rated_load_N: null"


def _force_band(design: Design) -> ForceBand:
    """A quarter of the smallest step at most, and no finer than a hand can hold."""
    gap = min(float(np.diff([0.0, *np.sort(np.abs(levels))]).min()) for levels in design.levels)
    top = max(abs(f) for levels in design.levels for f in levels)
    return ForceBand(
        absolute_N=max(_HOLDABLE_N, min(_USUAL.absolute_N, gap / 4)),
        relative=min(_USUAL.relative, gap / (4 * top)),
    )


def _rate_Hz(design: Design, old: MeasurementProtocol | None) -> float:
    """The old one where about that was measured: slots are late, or missed."""
    rate = float(np.clip(1 / design.sample_s, 0.1, 10))
    if old is not None and abs(rate / old.sampling.rate_Hz - 1) < 0.25:
        return old.sampling.rate_Hz
    return float(f"{rate:.2g}")


def _seconds(duration_s: float) -> str:
    """As people set a time: whole seconds, of a short one two digits; not less than was meant."""
    step = 1.0 if duration_s >= 10 else 0.1
    return f"{step * math.ceil(duration_s / step - 1e-9):g}"


def _displacement_mm(old: MeasurementProtocol | None) -> float:
    limit = None if old is None else old.limits.displacement_mm
    return min(limit.max, _LASER_MM) if limit is not None else _LASER_MM
