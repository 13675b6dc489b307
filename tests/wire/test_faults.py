"""Each fault of each device in a whole measurement: message, exit status, kept data.

The quick selection runs always; `-m slow` runs all. Set RIG_FAULT_TABLE to a file to collect the
table of docs/faults.md (see docs/faults.py).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.ild2200.emulator import Ild2200Emulator
from drivers.kistler.emulator import KistlerEmulator
from drivers.ur10e.emulator import Ur10eEmulator
from rig.dataset import load
from tests.wire.short import run_rig, write_files

DEVICES = {"robot": Ur10eEmulator, "dynamometer": KistlerEmulator, "laser": Ild2200Emulator}
QUICK = {
    ("robot", "frozen_timestamp", "mid-run"),
    ("robot", "silence", "start"),
    ("dynamometer", "unplugged", "mid-run"),
    ("laser", "close", "mid-run"),
    ("laser", "relative_zero", "start"),
}
# What a measurement survives, and why.
HARMLESS = {
    ("robot", "slow_start", "mid-run"): "shows itself when a client connects, and one is connected",
    ("robot", "wrong_version", "mid-run"): "shows itself when a client connects",
    ("robot", "program_stopped", "start"): "the arm stands still whether a program runs or not",
    ("dynamometer", "no_reset", "start"): "unloaded, the tare in software takes the charge away",
    ("dynamometer", "no_reset", "mid-run"): "as at start",
    ("laser", "mute_to_commands", "mid-run"): "commands are only sent at the start",
    ("laser", "lost_bytes", "start"): "counted as invalid values",
    ("laser", "lost_bytes", "mid-run"): "counted as invalid values",
    ("laser", "bit_flips", "start"): "implausible values are counted as invalid",
    ("laser", "bit_flips", "mid-run"): "implausible values are counted as invalid",
}
NOTED = {"lost_bytes", "bit_flips"}
# Found by what the protocol says (pose, limits), which names the quantity instead of the device.
NAMED = {
    ("joint_deviation", "start"): "deg away from pose P1 (allowed 0.5 deg)",
    ("joint_deviation", "mid-run"): "deg is above the limit of 5 deg",
    ("hot_joint", "start"): "joint temperature 85 deg C is above the limit of 60 deg C",
    ("hot_joint", "mid-run"): "joint temperature 85 deg C is above the limit of 60 deg C",
}

CASES = [
    pytest.param(
        device,
        fault,
        when,
        marks=[] if (device, fault, when) in QUICK else [pytest.mark.slow],
        id=f"{device}-{fault}-{when}",
    )
    for device, emulator in DEVICES.items()
    for fault in emulator.faults
    for when in ("start", "mid-run")
]


@pytest.mark.parametrize(("device", "fault", "when"), CASES)
def test_fault(
    tmp_path: Path, device: str, fault: str, when: str, fault_table: Callable[..., None]
) -> None:
    # mid-run comes after the first rows, on a machine that does other work as well
    moment, speed = ("at: start", 30) if when == "start" else ("after_s: 45", 15)
    faults = f"[{{device: {device}, kind: {fault}, {moment}}}]"
    words = write_files(tmp_path, faults=faults, speed=speed)
    outcome = run_rig(*words, cwd=tmp_path, timeout=60)
    message = outcome.stderr.strip().splitlines()[-1]
    harmless = HARMLESS.get((device, fault, when))
    fault_table(device, fault, when, f"exit {outcome.status}", harmless or message)
    assert "Traceback" not in outcome.stderr
    assert "bug in rig" not in outcome.stderr
    if harmless:
        assert outcome.status == 0, outcome.stderr
        dataset = load(tmp_path / "run.h5")
        assert dataset.complete
        assert fault not in NOTED or dataset.columns["laser_invalid"].sum() > 0
        return
    assert outcome.status in (3, 4), outcome.stderr
    assert NAMED.get((fault, when), f"{device}: ") in message
    assert len(message.split(". ")) >= 2, f"fault and remedy: {message}"
    assert outcome.stderr.count(message.removeprefix("Stopped for safety. ")) == 1
    if when == "mid-run":
        dataset = load(tmp_path / "run.h5")
        assert not dataset.complete
        assert dataset.rows > 0
    else:
        assert not (tmp_path / "run.h5.journal").exists() or load(tmp_path / "run.h5")
