"""`rig measure` as a user runs it: real client libraries, emulators, a data set at the end."""

from __future__ import annotations

import errno
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from rig.dataset import Dataset, load
from tests.wire.short import HOME, run_rig, write_files

STEPS = [(rep, step) for rep in (1, 2) for step in (1, 2, 3)]


def steps_of(dataset: Dataset) -> list[tuple[int, int]]:
    """Steps with usable, settled rows, in order."""
    c = dataset.columns
    use = (c["discarded"] == 0) & (c["settled"] == 1) & (c["step"] > 0)
    pairs = zip(c["repetition"][use], c["step"][use], strict=True)
    return list(dict.fromkeys((int(r), int(s)) for r, s in pairs))


def slots_of(dataset: Dataset) -> int:
    """Sampling slots of a measurement, served or missed; none where it ended before the first."""
    if not dataset.rows:
        return 0
    return dataset.rows + int(np.sum(dataset.columns["slots_missed"]))


def no_process_left(folder: Path) -> bool:
    """Emulators and robot clients of a run in `folder` have ended, within some seconds."""
    for _ in range(50):
        mine = [p for p in psutil.process_iter(["cwd"]) if p.info["cwd"] == str(folder)]
        if not mine:
            return True
        time.sleep(0.2)
    return False


def test_a_short_run_ends_complete_and_marked_as_emulated(tmp_path: Path) -> None:
    outcome = run_rig(*write_files(tmp_path, sample_rate_Hz=1000), cwd=tmp_path)
    assert outcome.status == 0, outcome.stderr
    assert "EMULATED" in outcome.stderr
    dataset = load(tmp_path / "run.h5")
    assert dataset.complete
    assert dataset.origin == "emulated"
    assert not (tmp_path / "run.h5.journal").exists()
    assert steps_of(dataset) == STEPS
    columns = dataset.columns
    use = (columns["step"] == 3) & (columns["settled"] == 1)
    assert columns["force_N"][use] == pytest.approx(60.0, abs=2.5)
    assert np.all(columns["robot_count"] > 0)
    assert np.all(columns["laser_count"] > 0)
    for name in ("q1_rad", "temperature6_C", "laser_mm", "dynamometer1_V", "lateness_s"):
        assert np.all(np.isfinite(columns[name])), name
    assert dataset.devices["laser"]["source"] == "emulated+ild2200"
    assert dataset.calibration["dynamometer"]["full_scale_N"]["x"] == 500
    assert dataset.calibration["laser"]["range_mm"] == 10
    assert "schema: rig.protocol/1" in dataset.texts["protocol"]
    assert "schema: rig.station/1" in dataset.texts["station"]
    assert no_process_left(tmp_path)


@pytest.mark.slow
def test_a_speed_that_no_machine_keeps_is_said_to_be_too_high(tmp_path: Path) -> None:
    for speed in (400, 300, 200):  # so fast devices may seem to fail before there is much to count
        folder = tmp_path / str(speed)
        folder.mkdir()
        outcome = run_rig(*write_files(folder), "--speed", str(speed), cwd=folder)
        assert outcome.status in (0, 3), outcome.stderr
        if (folder / "run.h5").exists() and slots_of(load(folder / "run.h5")) >= 60:
            break
    said = re.findall(
        rf"This machine can't keep up with {speed} times real time: .*", outcome.stderr
    )
    assert len(said) == 2, outcome.stderr  # when it is noticed, and at the end
    noted = [e["text"] for e in load(folder / "run.h5").events if e["kind"] == "behind"]
    assert noted == said[1:]


@pytest.mark.slow
def test_an_amplifier_without_a_line_is_switched_by_the_emulated_hand(tmp_path: Path) -> None:
    words = write_files(tmp_path, repetitions=1, reset_line="null")
    outcome = run_rig(*words, cwd=tmp_path)
    assert outcome.status == 0, outcome.stderr
    dataset = load(tmp_path / "run.h5")
    assert steps_of(dataset) == STEPS[:3]
    columns = dataset.columns
    zero = (columns["branch"] == "zero") & (columns["settled"] == 1)
    assert columns["force_N"][zero] == pytest.approx(0.0, abs=1.0)
    asked = [e["key"] for e in dataset.events if e["kind"] == "prompt"]
    assert asked.count("reset") == 2
    assert asked.count("operate") == 1


def test_measurements_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "run.h5").write_bytes(b"precious")
    outcome = run_rig(*write_files(tmp_path), cwd=tmp_path)
    assert outcome.status == 2
    assert "run.h5: exists already, and measurements are never overwritten" in outcome.stderr
    assert (tmp_path / "run.h5").read_bytes() == b"precious"


def started(
    folder: Path,
    words: list[str],
    terminal: int | None = None,
    hangup: signal.Handlers = signal.SIG_DFL,
) -> subprocess.Popen[str]:
    """A measurement in the background, returned once it has recorded some rows. terminal: on which
    it runs, as if it had been opened for it. hangup: what it was told to do when that is closed,
    whatever the tests were (nohup)."""
    heard = f"signal.signal(signal.SIGHUP, {hangup:d}); " if hasattr(signal, "SIGHUP") else ""
    own = "os.open(os.ttyname(0), os.O_RDWR); " if terminal is not None else ""
    code = f"import os, signal; {heard}{own}from rig.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words],
        cwd=folder,
        stderr=subprocess.PIPE if terminal is None else terminal,
        stdout=terminal,
        text=True,
        stdin=subprocess.DEVNULL if terminal is None else terminal,
        start_new_session=terminal is not None,
        env={**os.environ, "PYTHONPATH": str(HOME)},
    )
    wait_for_rows(process, folder, 8)
    return process


def wait_for_rows(process: subprocess.Popen[str], folder: Path, rows: int) -> None:
    """Until the measurement has recorded so many."""
    journal = folder / "run.h5.journal"
    for _ in range(400):
        if journal.exists() and journal.read_text(errors="replace").count('"sample"') >= rows:
            return
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.05)
    process.kill()
    pytest.fail(f"no {rows} rows within 20 s")


def test_ctrl_c_asks_and_the_answer_stops_with_status_4(tmp_path: Path) -> None:
    process = started(tmp_path, write_files(tmp_path))
    process.send_signal(signal.SIGINT)  # the scripted operator answers: abort
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 4, errors
    assert "Turn the screw back" in errors
    assert "Traceback" not in errors
    dataset = load(tmp_path / "run.h5")
    assert not dataset.complete
    assert dataset.rows >= 8


@pytest.mark.parametrize(
    "number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.slow)]
)
def test_being_ended_writes_the_file(tmp_path: Path, number: int) -> None:
    process = started(tmp_path, write_files(tmp_path))
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert "Interrupted. " in errors
    assert not load(tmp_path / "run.h5").complete
    assert no_process_left(tmp_path)


def test_a_terminal_that_is_closed_costs_no_data(tmp_path: Path) -> None:
    window, terminal = pty.openpty()
    process = started(tmp_path, write_files(tmp_path), terminal)
    os.close(terminal)
    os.close(window)
    assert process.wait(timeout=60) == 130
    assert load(tmp_path / "run.h5").rows >= 8
    assert no_process_left(tmp_path)


@pytest.mark.slow
def test_a_hangup_that_was_to_be_ignored_ends_nothing(tmp_path: Path) -> None:
    process = started(tmp_path, write_files(tmp_path), hangup=signal.SIG_IGN)  # as nohup does
    process.send_signal(signal.SIGHUP)
    wait_for_rows(process, tmp_path, 16)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 4, errors  # by the answer to Ctrl-C


def test_a_full_disk_ends_with_what_to_do_and_resumes(tmp_path: Path) -> None:
    words = write_files(tmp_path, repetitions=1)
    full = run_rig(*words, cwd=tmp_path, largest_file=50_000)
    assert full.status == 4, full.stderr
    reason = os.strerror(errno.EFBIG)
    # on a busy machine it says, too, that this is too fast for it
    said = [line for line in full.stderr.splitlines() if "can't keep up" not in line]
    data, end = said[-2:]
    assert data == (
        f"run.h5: cannot be written: {reason}. Choose another folder, or make room. What was "
        "measured is kept in run.h5.journal. To go on once that is mended: rig measure --resume "
        "run.h5"
    )
    assert end.startswith("Stopped: run.h5")
    assert f": {reason}." in end
    assert re.search("Unload the arm|Turn the screw back", end)
    assert len(said) < 15
    again = run_rig("measure", "--resume", "run.h5", cwd=tmp_path)
    assert again.status == 0, again.stderr
    assert steps_of(load(tmp_path / "run.h5")) == STEPS[:3]


@pytest.mark.slow
def test_a_second_one_leaves_the_devices_of_the_first_alone(tmp_path: Path) -> None:
    process = started(tmp_path, write_files(tmp_path))
    second = run_rig("measure", "--resume", "run.h5", cwd=tmp_path)
    assert second.status == 2
    assert second.stderr.splitlines() == [
        "run.h5.journal: another measurement is writing this journal. End it, or choose another "
        "name."
    ]
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def test_kill_then_resume_measures_the_same_steps_at_the_same_speed(tmp_path: Path) -> None:
    kill_and_resume(tmp_path, 0.3, "--speed", "25")
    assert load(tmp_path / "run.h5").devices["operator"]["clock"] == "25 times real time"


@pytest.mark.slow
@pytest.mark.parametrize("round_", range(100))
def test_kill_at_random_moments(tmp_path: Path, round_: int) -> None:
    delay = np.random.default_rng(round_).uniform(0.0, 2.5)
    kill_and_resume(tmp_path, delay)


def kill_and_resume(folder: Path, delay_s: float, *words: str) -> None:
    """kill -9 some time after the first rows; nothing acknowledged may be missing afterwards."""
    process = started(folder, [*write_files(folder), *words])
    time.sleep(delay_s)
    process.kill()
    process.wait()
    lines = (folder / "run.h5").exists(), (folder / "run.h5.journal").exists()
    if not lines[1]:
        assert load(folder / "run.h5").complete  # it was faster than the kill
        return
    acknowledged = _samples(folder / "run.h5.journal")
    before = load(folder / "run.h5")
    assert before.rows == len(acknowledged)
    assert no_process_left(folder), "emulators must not outlive a killed measurement"
    for _ in range(3):  # to whom a busy machine gives no time a device may seem to fail
        outcome = run_rig("measure", "--resume", "run.h5", cwd=folder)
        if outcome.status != 3:
            break
    assert outcome.status == 0, outcome.stderr
    after = load(folder / "run.h5")
    assert after.complete
    assert steps_of(after) == STEPS
    kept = after.columns["force_N"][: len(acknowledged)]
    assert [row["values"]["force_N"] for row in acknowledged] == pytest.approx(list(kept))
    counts = dict.fromkeys(STEPS, 0)
    c = after.columns
    use = (c["discarded"] == 0) & (c["settled"] == 1) & (c["step"] > 0)
    for rep, step in zip(c["repetition"][use], c["step"][use], strict=True):
        counts[int(rep), int(step)] += 1
    assert set(counts.values()) == {3}, "every step has its samples once"


def _samples(journal: Path) -> list[dict[str, object]]:
    """Whole lines of the journal that are samples; a torn last line was never acknowledged."""
    rows = []
    for line in journal.read_bytes().splitlines():
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if record.get("kind") == "sample":
            rows.append(record["data"])
    return rows
