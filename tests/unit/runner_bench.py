"""A rig in memory, on which the procedure runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drivers.interfaces import LiveView
from rig.journal import Journal, replay
from rig.procedure.acquisition import Acquisition
from rig.procedure.devices import Devices
from rig.procedure.progress import Progress, read_progress
from rig.procedure.recorder import Recorder
from rig.protocol import parse_protocol
from rig.runner import Runner
from tests.unit.fake_rig import Arm, FakeDynamometer, FakeLaser, FakeLoader, FakeRobot, JumpClock

PROTOCOL = """\
schema: rig.protocol/1
title: test
station: emulated
robot: ur10e
poses:
  P1: {q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57], tcp_xyz_mm: [0, 0, 0],
    program: go.urp}
move_arm: false
joint_encoder: output
directions: {x: [1, 0, 0]}
runs:
  - {pose: P1, direction: x, steps_N: [20, 40, 60]}
repetitions: 2
branches: loading
order: by_run
sampling: {rate_Hz: 1, samples_per_step: 3}
hold_s: 0
force_band: {absolute_N: 0.5, relative: 0.01}
settle: {window_s: 2, force_slope_N_per_s: 0.05, force_spread_N: 0.3,
  displacement_slope_mm_per_s: 0.002, displacement_spread_mm: 0.01, deadline_s: 20,
  at_deadline: record}
step_deadline_s: 30
zero: {before_s: 2, after_s: 2}
rest_s: 1
rated_load_N: null
limits:
  force_N: {max: 100, at: stop}
  displacement_mm: {max: 5, at: pause}
  displacement_rate_mm_per_s: {max: 100, at: warn}
prompts: {}
"""

MOVING = PROTOCOL.replace("move_arm: false", "move_arm: true")

Step = tuple[int, str, int]


class Bench:
    """One measurement in memory, with its journal on disk."""

    def __init__(self, folder: Path, text: str = PROTOCOL) -> None:
        self.protocol = parse_protocol(text, folder / "test.yaml")
        self.clock = JumpClock()
        self.arm = Arm(self.clock)
        self.robot = FakeRobot(self.arm)
        self.loader = FakeLoader(self.arm)
        self.dynamometer = FakeDynamometer(self.arm)
        self.devices = Devices(self.robot, self.dynamometer, FakeLaser(self.arm))
        self.path = folder / "run.h5.journal"
        self.checkpoints = 0
        self.runner: Runner | None = None

    def run(self) -> None:
        if self.path.exists():
            journal = Journal.reopen(self.path)
            progress = read_progress(journal.records)
        else:
            journal, progress = Journal.create(self.path, {}), Progress()
        acquisition = Acquisition(self.devices, self.clock, 1.0, progress.session_s)
        recorder = Recorder(journal, self.devices, acquisition.now, 1, progress.rows)
        self.runner = Runner(
            self.protocol, acquisition, self.loader, recorder, progress, self.check
        )
        try:
            self.runner.run()
        finally:
            journal.close()

    def check(self) -> None:
        self.checkpoints += 1

    def records(self, kind: str) -> list[dict[str, Any]]:
        return [r.data for r in replay(self.path) if r.kind == kind]

    def events(self, kind: str) -> list[dict[str, Any]]:
        return [e for e in self.records("event") if e["kind"] == kind]

    def good(self) -> list[dict[str, Any]]:
        """Rows that are not discarded."""
        bad = {i for e in self.events("discard") for i in range(e["first"], e["last"] + 1)}
        return [row for i, row in enumerate(self.records("sample")) if i not in bad]

    def steps(self) -> list[Step]:
        """Steps of the usable settled rows, in order, once each."""
        rows = [r for r in self.good() if r["values"]["settled"] and r["step"]]
        return list(dict.fromkeys((r["repetition"], r["branch"], r["step"]) for r in rows))


ALL = [(rep, "loading", step) for rep in (1, 2) for step in (1, 2, 3)]


def at(bench: Bench, step: int, act: Any, phase: str = "sampling", samples: int = 1) -> None:
    """Does something once, in the middle of a step."""
    done: list[bool] = []

    def script(view: LiveView) -> None:
        here = (view.step, view.phase, view.samples) == (step, phase, samples)
        if here and not done:
            done.append(True)
            act()

    bench.loader.script = script


def resumed(bench: Bench) -> int:
    """Mends what is broken and goes on; how many samples there were before."""
    before = len(bench.records("sample"))
    bench.arm.broken.clear()
    bench.loader.script = lambda _view: None
    bench.run()
    return before
