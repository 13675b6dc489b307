"""Shape of a protocol file (schema rig.protocol/1), and the checks that reach across its keys.

The shape is validated value by value by `rig.yaml.yamlfile`; `check` adds what depends on several
values at once. Units are those of the keys.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import hypot, isclose, pi
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt, Interval, Le, MinLen

from rig.errors import did_you_mean
from rig.yaml.yamlnodes import Key

LONGEST_TOOL_MM = 2000  # of protocols and models

Triple = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
_FORBID = {"extra": "forbid"}

MAX_STEPS = 1000
# Directions are written with a few digits; further from length 1 than this is a mistake.
UNIT_TOLERANCE = 1e-3
_NAME = re.compile(r"[\w+-]{1,40}")


@dataclass(frozen=True, kw_only=True)
class PoseEntry:
    """A reference pose; exactly one of `q_deg` and `q_rad`."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    q_deg: Six | None = None
    q_rad: Six | None = None
    tcp_xyz_mm: Triple = (0.0, 0.0, 0.0)
    program: Annotated[str, MinLen(1)] | None = None

    def radians(self) -> Six:
        """Joint positions in rad."""
        if self.q_rad is not None:
            return self.q_rad
        assert self.q_deg is not None
        a, b, c, d, e, f = (angle * pi / 180 for angle in self.q_deg)
        return a, b, c, d, e, f


@dataclass(frozen=True, kw_only=True)
class Ramp:
    """Equal steps of force."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    from_N: Annotated[float, Gt(0), Le(50_000)]
    to_N: Annotated[float, Gt(0), Le(50_000)]
    by_N: Annotated[float, Gt(0), Le(50_000)]


@dataclass(frozen=True, kw_only=True)
class RunEntry:
    """Steps in one direction; exactly one of the three ways to give them."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    pose: str
    direction: str
    steps_N: Annotated[list[float], MinLen(1)] | None = None
    steps: Ramp | None = None
    steps_percent: Annotated[list[Annotated[float, Interval(gt=0, le=100)]], MinLen(1)] | None = (
        None
    )
    stop_at_displacement_mm: Annotated[float, Gt(0)] | None = None

    def __post_init__(self) -> None:
        """Said with the mistakes of single values; what is wrong between keys is looked at once
        there are none."""
        if len(self._steps_keys()) != 1:
            raise ValueError("give the steps as steps_N, steps or steps_percent, and one of them.")

    def _steps_keys(self) -> list[str]:
        keys = ("steps_N", "steps", "steps_percent")
        return [key for key in keys if getattr(self, key) is not None]

    def steps_key(self) -> str:
        """The one key that gives the steps."""
        (key,) = self._steps_keys()
        return key

    def forces_N(self, rated_load_N: float | None) -> tuple[float, ...]:
        """Levels in the order of loading; empty where they cannot be told."""
        if self.steps_N is not None:
            return tuple(self.steps_N)
        if self.steps_percent is not None:
            return tuple(p * (rated_load_N or 0.0) / 100 for p in self.steps_percent)
        if self.steps is None:
            return ()
        ramp = self.steps
        count = round((ramp.to_N - ramp.from_N) / ramp.by_N)
        if not 0 <= count < MAX_STEPS:
            return ()
        return tuple(round(ramp.from_N + i * ramp.by_N, 9) for i in range(count + 1))


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Rate of the recorded values, and how many a settled step has at least."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    rate_Hz: Annotated[float, Interval(ge=0.1, le=10)]
    samples_per_step: Annotated[int, Interval(ge=1, le=100_000)]


@dataclass(frozen=True, kw_only=True)
class ForceBand:
    """How close to its target a force must be: the wider of the two half widths counts."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    absolute_N: Annotated[float, Gt(0)]
    relative: Annotated[float, Interval(ge=0, le=0.5)] = 0.0

    def half_width_N(self, target_N: float) -> float:
        """max(absolute_N, relative |target|)."""
        return max(self.absolute_N, self.relative * abs(target_N))


@dataclass(frozen=True, kw_only=True)
class Settle:
    """When the arm counts as at rest: slope and spread over the last `window_s` seconds."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    window_s: Annotated[float, Interval(ge=0.5, le=3600)]
    force_slope_N_per_s: Annotated[float, Gt(0)]
    force_spread_N: Annotated[float, Gt(0)]
    displacement_slope_mm_per_s: Annotated[float, Gt(0)]
    displacement_spread_mm: Annotated[float, Gt(0)]
    deadline_s: Annotated[float, Interval(gt=0, le=86_400)]
    at_deadline: Literal["record", "ask", "stop"]


@dataclass(frozen=True, kw_only=True)
class Zero:
    """Length of the plateaus without load before and after a repetition."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    before_s: Annotated[float, Interval(gt=0, le=3600)]
    after_s: Annotated[float, Interval(ge=0, le=3600)]


@dataclass(frozen=True, kw_only=True)
class Limit:
    """The largest magnitude allowed, in the unit of the key above, and what happens beyond it."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    max: Annotated[float, Gt(0)]
    at: Literal["stop", "pause", "warn"]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What is watched while measuring; None is not watched."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    force_N: Limit | None = None
    force_rate_N_per_s: Limit | None = None
    displacement_mm: Limit | None = None
    displacement_rate_mm_per_s: Limit | None = None
    joint_deviation_deg: Limit | None = None
    joint_temperature_C: Limit | None = None


@dataclass(frozen=True, kw_only=True)
class Prompts:
    """Words for the operator, besides the built-in ones."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    before_run: str | None = None


@dataclass(frozen=True, kw_only=True)
class ProtocolFile:
    """A protocol as it is written."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    schema: Literal["rig.protocol/1"]
    title: Annotated[str, MinLen(1)]
    station: Annotated[str, MinLen(1)]
    robot: Annotated[str, MinLen(1)]
    poses: Annotated[dict[str, PoseEntry], MinLen(1)]
    move_arm: bool = False
    joint_encoder: Literal["output", "motor"]
    directions: Annotated[dict[str, Triple], MinLen(1)]
    runs: Annotated[list[RunEntry], MinLen(1)]
    repetitions: Annotated[int, Interval(ge=1, le=1000)]
    branches: Literal["loading", "loading-unloading"] = "loading"
    order: Literal["by_run", "by_repetition"] = "by_run"
    sampling: Sampling
    hold_s: Annotated[float, Interval(ge=0, le=86_400)] = 0.0
    force_band: ForceBand
    settle: Settle
    step_deadline_s: Annotated[float, Interval(gt=0, le=86_400)]
    zero: Zero
    rest_s: Annotated[float, Interval(ge=0, le=86_400)] = 0.0
    rated_load_N: Annotated[float, Interval(gt=0, le=50_000)] | None = None
    limits: Limits = field(default_factory=Limits)
    prompts: Prompts = field(default_factory=Prompts)


Found = Iterator[tuple[Key, str]]


def check(written: ProtocolFile, robots: list[str]) -> Found:
    """(path, what is wrong) for everything that does not hold across the keys of the file.

    `robots`: the known names; a robot may also be the path of a robot file.
    """
    yield from _names(written, robots)
    yield from _poses(written)
    yield from _directions(written)
    yield from _times(written)
    for n, run in enumerate(written.runs):
        for path, what in _run(written, run):
            yield ("runs", n, *path), what
    yield from _duplicates(written)


def _names(written: ProtocolFile, robots: list[str]) -> Found:
    if not written.robot.endswith((".yaml", ".yml")) and written.robot not in robots:
        yield ("robot",), f'"{written.robot}" is unknown.{did_you_mean(written.robot, robots)}'
    for key in ("poses", "directions"):
        for name in getattr(written, key):
            if not _NAME.fullmatch(name):
                yield (key, name), "a name has letters, digits, _, + and -, at most 40."


def _poses(written: ProtocolFile) -> Found:
    used = {run.pose for run in written.runs}
    for name, pose in written.poses.items():
        path = ("poses", name)
        if (pose.q_deg is None) == (pose.q_rad is None):
            yield path, "give the joint positions as q_deg or as q_rad, and one of them."
            continue
        key, turn, unit = ("q_deg", 360.0, "deg") if pose.q_deg else ("q_rad", 2 * pi, "rad")
        beyond = [f"{q:.10g}" for q in getattr(pose, key) if abs(q) > turn * (1 + 1e-9)]
        if beyond:
            hint = " Are these degrees? Then call them q_deg." if unit == "rad" else ""
            what = f"{', '.join(beyond)} {unit}: beyond a full turn; allowed: -{turn:.5g} to "
            yield (*path, key), f"{what}{turn:.5g} {unit}.{hint}"
        for i, value in enumerate(pose.tcp_xyz_mm):
            if abs(value) > LONGEST_TOOL_MM:
                yield (
                    (*path, "tcp_xyz_mm", i),
                    f"{value:.10g} mm is no tool; allowed: "
                    f"{-LONGEST_TOOL_MM} to {LONGEST_TOOL_MM} mm.",
                )
        if pose.program is not None and not pose.program.isprintable():
            what = f"{pose.program!r} holds a character that cannot be printed; write the "
            yield (*path, "program"), what + "program's name as the pendant shows it."
        if written.move_arm and name in used and pose.program is None:
            what = "move_arm is true, and this pose has no program; name the one taught on the "
            yield path, what + "pendant, or set move_arm to false."


def _directions(written: ProtocolFile) -> Found:
    for name, vector in written.directions.items():
        length = hypot(*vector)
        if length == 0.0:
            yield ("directions", name), "has length 0; a unit vector is wanted."
        elif abs(length - 1.0) > UNIT_TOLERANCE:
            unit = ", ".join(f"{v / length:.6g}" for v in vector)
            what = f"has length {length:.6g}; a unit vector is wanted. Write [{unit}]"
            yield ("directions", name), f"{what} for this direction."


def _times(written: ProtocolFile) -> Found:
    settle, rate_Hz = written.settle, written.sampling.rate_Hz
    if settle.deadline_s <= settle.window_s:
        yield (
            ("settle", "deadline_s"),
            f"{settle.deadline_s:.10g} s is not longer than window_s, {settle.window_s:.10g} s: "
            "no step could settle in time.",
        )
    for key in ("before_s", "after_s"):
        seconds = getattr(written.zero, key)
        if 0 < seconds < 1 / rate_Hz:
            what = f"{seconds:.10g} s holds no sample at {rate_Hz:.10g} Hz; allowed: at least "
            yield ("zero", key), f"{what}{1 / rate_Hz:.4g} s."


def _run(written: ProtocolFile, run: RunEntry) -> Found:
    if run.pose not in written.poses:
        yield ("pose",), f'"{run.pose}" is unknown.{did_you_mean(run.pose, written.poses)}'
    if run.direction not in written.directions:
        hint = did_you_mean(run.direction, written.directions)
        yield ("direction",), f'"{run.direction}" is unknown.{hint}'
    yield from _stop_displacement(written, run)
    key = run.steps_key()
    if key == "steps_percent" and written.rated_load_N is None:
        yield (key,), "percent of what? rated_load_N is not given; write it."
    elif run.steps is not None:
        problem = _ramp(run.steps)
        if problem:
            yield ("steps",), problem
        else:
            yield from _levels(written, run, key)
    else:
        yield from _levels(written, run, key)


def _stop_displacement(written: ProtocolFile, run: RunEntry) -> Found:
    top, limit = run.stop_at_displacement_mm, written.limits.displacement_mm
    if top is not None and limit is not None and top >= limit.max:
        what = f"{top:.10g} mm is not below limits.displacement_mm.max, {limit.max:.10g} mm."
        yield ("stop_at_displacement_mm",), what


def _ramp(ramp: Ramp) -> str:
    if ramp.to_N < ramp.from_N:
        return f"ends at {ramp.to_N:.10g} N, below its start, {ramp.from_N:.10g} N; loading rises."
    count = (ramp.to_N - ramp.from_N) / ramp.by_N
    if count >= MAX_STEPS:
        return f"has {count:.4g} steps; allowed: at most {MAX_STEPS}. Make by_N larger."
    if not isclose(count, round(count), abs_tol=1e-6):
        last = ramp.from_N + int(count) * ramp.by_N
        return (
            f"steps of {ramp.by_N:.10g} N from {ramp.from_N:.10g} N never reach "
            f"{ramp.to_N:.10g} N; the last is {last:.10g} N. Write to_N: {last:.10g}, or another "
            "by_N."
        )
    return ""


def _levels(written: ProtocolFile, run: RunEntry, key: str) -> Found:
    """Forces must rise from above zero, with bands that do not overlap, below the limit."""
    levels = run.forces_N(written.rated_load_N)
    limit, band = written.limits.force_N, written.force_band
    if len(levels) > MAX_STEPS:
        yield (key,), f"{len(levels)} steps; allowed: at most {MAX_STEPS}."
    before, before_half = 0.0, 0.0
    for i, force in enumerate(levels):
        path: Key = (key,) if key == "steps" else (key, i)
        half = band.half_width_N(force)
        if force <= 0:
            what = "the screw pushes, and zero load has plateaus of its own; allowed: above 0 N."
            hint = " Give a direction of opposite sense." if force < 0 else ""
            yield path, f"{force:.10g} N: {what}{hint}"
        elif force <= before:
            what = f"{force:.10g} N after {before:.10g} N; loading rises from step to step."
            yield path, f"{what} Unloading: branches: loading-unloading."
        elif force - half <= before + before_half:
            what = f"{force:.10g} N +- {half:.4g} N overlaps {before:.10g} N +- {before_half:.4g} N"
            yield path, f"{what}, the level before; widen the step or narrow force_band."
        if limit is not None and force + half > limit.max:
            what = f"{force:.10g} N +- {half:.4g} N (force_band) passes limits.force_N.max"
            yield path, f"{what}, {limit.max:.10g} N."
            return
        before, before_half = force, half


def _duplicates(written: ProtocolFile) -> Found:
    seen: dict[tuple[str, str], int] = {}
    for n, run in enumerate(written.runs):
        first = seen.setdefault((run.pose, run.direction), n)
        if first != n:
            what = f"pose {run.pose}, direction {run.direction} stands in runs[{first}] already"
            yield ("runs", n), f"{what}; join the two, or raise repetitions."
