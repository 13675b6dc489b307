"""Situations of a measurement, as the page would be told of them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from math import nan

from rig.panel.picture import BANNER, LABELS
from rig.panel.state import (
    Choice,
    DeviceState,
    Displacement,
    Force,
    LimitState,
    Phase,
    Plan,
    PlannedRun,
    PromptState,
    RunState,
    Sample,
    SampleCount,
    SettleState,
    Slots,
    State,
    Turn,
    to_json,
)
from rig.procedure.supervision import PAUSE_ANSWERS

ARM = ((0, 0, 0), (0, 0, 181), (102, 24, 784), (540, 127, 426), (500, 290, 426), (750, 0, 400))
FORCES = tuple(float(n) for n in range(20, 240, 20))
PAUSED = PromptState(
    "7",
    "paused",
    "Paused. The arm may be under load.",
    tuple(Choice(k, LABELS[k]) for k in PAUSE_ANSWERS),
)
MOUNT = PromptState(
    "1",
    "mount",
    "Bring the arm to pose P1 (13.43, -99.84, -108.10, -62.06, 90.00, -76.57 deg), then let it "
    "stand. Set up screw, dynamometer and laser along x (1, 0, 0), not touching. Check that screw, "
    "dynamometer and laser point along the direction of this run.",
    (Choice("ok", LABELS["ok"]),),
)
UNLOAD = PromptState(
    "2",
    "unload",
    "Turn the screw back until it no longer touches the arm, then confirm.",
    (Choice("ok", LABELS["ok"]),),
)
LASER_FAULT = DeviceState(
    "laser",
    "fault",
    "no value for 1.2 s from /dev/ttyUSB0",
    "Check that the sensor's cable is plugged in and its lamp is green.",
)


def displacement_mm(force_N: float, repetition: int = 1) -> float:
    """A curve like the published one: soft towards the end, repetitions a little apart."""
    return force_N / 134 + (force_N / 220) ** 3 * 1.4 + 0.015 * (repetition - 2) * force_N / 220


def turning() -> State:
    """In mid-step, a little below the band."""
    return State(
        emulated=True,
        banner=BANNER,
        speed=50.0,
        protocol="Static stiffness of a UR10e along x and y",
        robot="ur10e",
        phase="turning",
        run=RunState("P1", "x", (1.0, 0.0, 0.0), 3, 3, 7, 11, "loading"),
        prompt=None,
        force=Force(126.4, 0.05, 140.0, 1.4, stale=False),
        turn=Turn("in", 0.27, 97.0, 13.6),
        displacement=Displacement(1.217, 0.05, stale=False),
        samples=SampleCount(0, 5),
        settle=None,
        countdown_s=nan,
        limits=(
            LimitState("force", 126.4, 240.0, "N", 0.473, "stop"),
            LimitState("force rate", 3.0, 60.0, "N/s", 0.95, "warn"),
            LimitState("displacement", 1.217, 9.0, "mm", 0.865, "stop"),
            LimitState("displacement rate", 0.02, 3.0, "mm/s", 0.993, "warn"),
            LimitState("joint deviation", 0.08, 5.0, "deg", 0.984, "stop"),
            LimitState("joint temperature", 51.0, 60.0, "deg C", 0.15, "stop"),
        ),
        devices=(
            DeviceState("robot", "ok"),
            DeviceState("dynamometer", "ok"),
            DeviceState("laser", "ok"),
            DeviceState("operator", "ok"),
        ),
        slots=Slots(0, 3.2),
        message="",
    )


def prompting(prompt: PromptState) -> State:
    """A question is open."""
    phase: Phase = "paused" if prompt.kind == "paused" else "prompt"
    return replace(turning(), phase=phase, prompt=prompt, turn=None)


def setting_up(prompt: PromptState = MOUNT) -> State:
    """A question before anything was measured."""
    return replace(
        prompting(prompt),
        run=RunState("P1", "x", (1.0, 0.0, 0.0), 1, 3, 0, 11, "zero"),
        force=Force(nan, nan, nan, 0.0, stale=True),
        displacement=Displacement(nan, nan, stale=True),
        samples=SampleCount(0, 0),
        slots=Slots(0, nan),
    )


def settling() -> State:
    """Hands off, in the band."""
    return replace(
        turning(),
        phase="settling",
        turn=None,
        force=Force(140.6, 0.05, 140.0, 1.4, stale=False),
        settle=SettleState(2.6, 4.0, ""),
    )


def laser_failed() -> State:
    """The laser says nothing any more; its value is old."""
    state = turning()
    return replace(
        state,
        displacement=Displacement(1.217, 1.2, stale=True),
        devices=(*state.devices[:2], LASER_FAULT, state.devices[3]),
    )


def plan() -> dict[str, object]:
    """What the run is going to be."""
    run = PlannedRun("P1", "x", (1.0, 0.0, 0.0), FORCES)
    title = "Static stiffness of a UR10e along x and y"
    return _item("plan", Plan(title, "ur10e", 3, 0.5, 1.0, (run,), {"P1": ARM}))


def prediction() -> dict[str, object]:
    """Of the simulation with six linear springs."""
    return {"prediction": {"P1|x": [[f, f / 96] for f in (0.0, 110.0, 220.0)]}}


def samples(count: int, repetitions: int = 3, up_to: float = 1.0) -> list[dict[str, object]]:
    """`count` rows over the repetitions; the last repetition goes up to a share of its steps."""
    per_step = max(1, count // (repetitions * len(FORCES)))
    items: list[dict[str, object]] = []
    for repetition in range(1, repetitions + 1):
        for step, force in enumerate(FORCES, 1):
            if repetition == repetitions and step > up_to * len(FORCES):
                continue
            for n in range(per_step):
                row = len(items)
                noise = 0.3 * math.sin(12.9898 * row)
                moved = displacement_mm(force + noise, repetition)
                time_s = 30.0 * step + n
                sample = Sample(
                    row,
                    "P1",
                    "x",
                    repetition,
                    step,
                    "loading",
                    settled=True,
                    force_N=force + noise,
                    displacement_mm=moved,
                    time_s=time_s,
                    session_s=400.0 * (repetition - 1) + time_s,
                )
                items.append(_item("sample", sample))
    return items


def _item(kind: str, value: object) -> dict[str, object]:
    return {kind: json.loads(to_json(value))}
