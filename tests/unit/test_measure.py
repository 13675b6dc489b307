"""What `rig measure` says, and when."""

from __future__ import annotations

import errno
import re
from contextlib import nullcontext
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.errors import DeviceError, ReadTimeout, SafetyStop
from drivers.interfaces import LiveView
from rig import measure
from rig.dataset import journal_path, load
from rig.emulation.host import EmulationHost
from rig.errors import InputError
from rig.journal import Journal, Record
from rig.panel.onlooker import Onlooker
from rig.procedure.devices import in_short
from rig.procedure.limits import UNLOAD
from rig.procedure.progress import Progress, read_progress
from rig.protocol import load_protocol
from rig.resuming import interrupted, resumed
from rig.station import load_station
from tests.unit.example_data import write_journal
from tests.unit.runner_bench import Bench, at

PROTOCOL = Path(__file__).parents[2] / "protocols" / "paper_xy.yaml"


def test_a_station_without_a_device_says_what_to_add(tmp_path: Path) -> None:
    station = tmp_path / "half.yaml"
    text = load_station("ur10e_lab").text
    laser = text[text.index("\nlaser:") : text.index("\noperator:")]
    robot = text[text.index("\nrobot:") : text.index("\ndynamometer:")]
    station.write_text(text.replace(laser, "").replace(robot, ""))
    with pytest.raises(InputError) as caught:
        measure.measure(PROTOCOL, str(station), tmp_path / "x.h5", print)
    assert str(caught.value) == (
        f"{station}: the station has no robot and no laser; measuring needs robot, dynamometer and "
        "laser. Add `robot:` and `laser:` as in protocols/stations/ur10e_lab.yaml."
    )


def test_what_must_be_read_is_said_before_the_screen_moves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said: list[str] = []
    loader = SimpleNamespace(open=lambda: said.append("(screen)"), close=lambda: None)
    stand_ins = {
        "emulated_rig": lambda station, _protocol, _before: nullcontext(station),
        "make_devices": lambda *_: None,
        "open_devices": lambda *_: None,
        "refuse_emulators": lambda *_: None,
        "make_loader": lambda *_: loader,
        "LoaderWithBar": lambda inner, *_: inner,
    }
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(measure, name, stand_in)
    protocol, station = load_protocol(PROTOCOL), load_station("emulated")
    progress = Progress(rows=225, first_rows={(0, 1): 191})
    with measure._opened(protocol, station, progress, said.append, None):
        assert "no keys are heard" in said[-5]
        anew = interrupted(protocol, progress)
        assert "34 rows" in anew
        assert said[-4:] == ["resuming after 225 rows", anew, measure.SAFETY_NOTE, "(screen)"]


def test_units_stand_behind_what_devices_say_of_themselves() -> None:
    identity = {"model": "ILD2200", "range_mm": "10", "output_rate_Hz": "2500", "averaging": "1"}
    assert in_short(identity) == "model ILD2200, range 10 mm, output rate 2500 Hz, averaging 1"


def test_a_data_set_is_named_as_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.csv: a data set is an HDF5 file; allowed endings"):
        measure.measure(PROTOCOL, "emulated", tmp_path / "x.csv", print)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_refuses_is_told_before_a_device_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> object:
        raise FileNotFoundError(errno.ENOENT, "No such file or directory")  # as /proc says

    monkeypatch.setattr("tempfile.mkstemp", refused)
    monkeypatch.setattr(measure, "_opened", lambda *_: pytest.fail("devices were opened"))
    words = (
        rf"x\.h5: nothing can be written into the folder {tmp_path} "
        r"\(No such file or directory\)\. Choose another with -o\."
    )
    with pytest.raises(InputError, match=words):
        measure.measure(PROTOCOL, "emulated", tmp_path / "x.h5", print)


def test_the_warnings_of_the_plan_are_told_before_a_device_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []

    class Opening(Exception):
        pass

    def opened(*_: object) -> object:
        raise Opening

    monkeypatch.setattr(measure, "_opened", opened)
    protocol = tmp_path / "tight.yaml"
    tight = "displacement_mm: {max: 1.2, at: stop}"
    protocol.write_text(re.sub(r"displacement_mm: \{max.*?\}", tight, PROTOCOL.read_text()))
    with pytest.raises(Opening):
        measure.measure(protocol, "emulated", tmp_path / "x.h5", said.append)
    assert said[0] == (
        "Warning: pose P1, direction x: about 1.6 mm expected at 220 N, limits.displacement_mm.max "
        "is 1.2 mm: 30 % too much, unless the arm is stiffer. Lower the top force, or give "
        "stop_at_displacement_mm."
    )
    assert not list(tmp_path.glob("*.h5*"))


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (SafetyStop("robot", "protective stop", "Keep clear."), "The robot has stopped for safety"),
        (ReadTimeout("laser", "silent", "Check."), "The laser has failed"),
    ],
)
def test_a_stop_for_safety_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: DeviceError, told: str
) -> None:
    bench = Bench(tmp_path)
    at(bench, 2, lambda: bench.arm.broken.update({error.device: error}))
    monkeypatch.setattr(measure, "_finish", lambda *_, **__: None)
    station = load_station("emulated")
    rig = measure._Rig(station, bench.devices, bench.loader, bench.clock, Onlooker())
    with Journal.create(bench.path, {}) as journal:
        job = measure.Job(tmp_path / "run.h5", bench.protocol, station, journal, Progress())
        with pytest.raises(type(error)):
            measure._carry_out(job, rig, print)
    assert f"{told}. {UNLOAD}" in bench.loader.said


@pytest.mark.parametrize(("speed", "synced"), [(50.0, False), (1.0, True), (0.5, True)])
def test_only_a_clock_that_runs_ahead_does_not_wait_for_the_disk(
    speed: float, synced: bool
) -> None:
    station = measure._at_speed(load_station("emulated"), speed)
    assert measure._synced(station) is synced


def test_a_real_station_waits_for_the_disk() -> None:
    assert measure._synced(replace(load_station("emulated"), emulation=None))


def test_a_complete_run_whose_file_could_not_be_written_needs_no_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure, "_opened", lambda *_: pytest.fail("devices were opened"))
    target = tmp_path / "a.h5"
    write_journal(target, 4, stop=True)
    assert measure.resume(target, print) == target
    assert load(target).complete
    assert not journal_path(target).exists()


def test_an_interrupt_is_told_where_the_screen_no_longer_covers_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path)
    said: list[str] = []

    def interrupted(view: LiveView) -> None:
        if view.step:
            raise KeyboardInterrupt

    bench.loader.script = interrupted
    monkeypatch.setattr(bench.loader, "close", lambda: said.append("(the screen goes)"))
    monkeypatch.setattr(measure, "_finish", lambda *_, **__: None)
    station = load_station("emulated")
    rig = measure._Rig(station, bench.devices, bench.loader, bench.clock, Onlooker())
    with Journal.create(bench.path, {}) as journal:
        job = measure.Job(tmp_path / "run.h5", bench.protocol, station, journal, Progress())
        with pytest.raises(KeyboardInterrupt):
            measure._carry_out(job, rig, said.append)
    assert said[:2] == ["(the screen goes)", f"Interrupted. {UNLOAD}"]


@pytest.mark.parametrize(("minutes_ago", "session_s"), [(25, 1500.0), (1, 128.4)])
def test_the_session_clock_counts_the_time_between_stop_and_resume(
    minutes_ago: float, session_s: float
) -> None:
    """Never backwards, whatever the computer's clock says."""
    progress = Progress(session_s=128.4)
    created = datetime.now().astimezone() - timedelta(minutes=minutes_ago)
    event = resumed(created.isoformat(timespec="seconds"), progress, emulated=False)
    assert progress.session_s == pytest.approx(session_s, abs=3.0)
    assert event["session_s"] == pytest.approx(progress.session_s, abs=1e-3)
    assert datetime.fromisoformat(str(event["at"])).tzinfo is not None
    assert str(event["text"]).endswith("s after the last record")


def test_the_session_clock_of_an_emulated_rig_goes_on_where_it_stopped() -> None:
    progress = Progress(session_s=128.4)
    event = resumed("2026-01-01T00:00:00+00:00", progress, emulated=True)
    assert (progress.session_s, event["session_s"]) == (128.4, 128.4)
    assert event["text"] == "measurement resumed; the emulated rig stood still meanwhile"


def test_the_session_clock_never_goes_back_behind_an_event() -> None:
    sample = Record(1, "sample", {"session_s": 135.06, "segment": 1})
    stopped = Record(2, "event", {"kind": "stopped", "text": "interrupted", "session_s": 135.42})
    assert read_progress([sample, stopped]).session_s == 135.42


def test_what_becomes_of_an_interrupted_repetition_is_told() -> None:
    protocol = load_protocol(PROTOCOL)
    progress = Progress(rows=46, first_rows={(0, 1): 0, (0, 2): 12}, repetitions={(0, 1)})
    assert interrupted(protocol, progress) == (
        "Pose P1, direction x: repetition 2 was interrupted and is measured anew as a whole. Its "
        "34 rows so far stay in the file, marked as discarded."
    )
    assert interrupted(protocol, replace(progress, repetitions={(0, 1), (0, 2)})) == ""


def fails(*_: object) -> object:
    raise ReadTimeout("dynamometer", "no samples for 1 s", "Check its cable.")


def test_the_speed_is_named_where_a_device_fails_far_ahead_of_real_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure, "_opened", fails)
    with pytest.raises(ReadTimeout, match=r"no samples for 1 s\. At 999 times real time"):
        measure.measure(PROTOCOL, "emulated", tmp_path / "a.h5", print, speed=999)


def test_the_speed_is_named_where_a_device_fails_after_resuming(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "b.h5"
    texts = {"protocol": load_protocol(PROTOCOL).text, "station": load_station("emulated").text}
    Journal.create(journal_path(target), texts).close()
    monkeypatch.setattr(measure, "_opened", fails)
    with pytest.raises(ReadTimeout, match=r"no samples for 1 s\. At 999 times real time"):
        measure.resume(target, print, speed=999)


def test_a_resumed_run_does_not_meet_the_scatter_of_its_beginning_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[int] = []

    def emulated(_station: object, _protocol: object, before: int) -> object:
        told.append(before)
        raise InputError("far enough")

    monkeypatch.setattr(measure, "emulated_rig", emulated)
    protocol, station = load_protocol(PROTOCOL), load_station("emulated")
    opened = measure._opened(protocol, station, Progress(segment=3), print, None)
    with pytest.raises(InputError, match="far enough"), opened:
        pass
    assert told == [3]
    host = EmulationHost(station, before=3)
    assert host.scene.world.impose(100.0, 1.0) != EmulationHost(station).scene.world.impose(
        100.0, 1.0
    )
