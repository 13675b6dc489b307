"""`rig measure`: from a protocol to a data set, whatever happens on the way."""

from __future__ import annotations

import signal
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from drivers.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import Loader
from rig import dataset as datasets
from rig.digits import counted
from rig.emulation.emulated import EmulatedRig
from rig.errors import InputError, MeasurementStopped
from rig.journal import Journal, JournalError, journal_path, replay
from rig.measured_meta import measured_meta
from rig.panel.onlooker import Onlooker
from rig.plan import plan
from rig.procedure.acquisition import Acquisition
from rig.procedure.devices import (
    Devices,
    failed,
    make_devices,
    make_loader,
    open_devices,
    refuse_emulators,
    station_clock,
)
from rig.procedure.limits import UNLOAD
from rig.procedure.pace import Pace, speed_named
from rig.procedure.progress import Progress, read_progress
from rig.procedure.progress_bar import LoaderWithBar
from rig.procedure.recorder import Recorder
from rig.protocol import MeasurementProtocol, load_protocol, parse_protocol
from rig.resuming import interrupted, resumed
from rig.runner import Runner
from rig.software import software_version
from rig.station import Station, parse_station, station_for
from rig.storage.files import check_ending, check_folder, check_writable
from rig.terminal import leave_lost_terminal

if TYPE_CHECKING:
    from rig.panel.link import PanelOptions

SAFETY_NOTE = (
    "Software monitoring is no safety function: keep the emergency stop within reach, "
    "and your hands where the arm can't trap them."
)

Say = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """One measurement: where it goes, what is to be done, what has been done already."""

    output: Path
    protocol: MeasurementProtocol
    station: Station
    journal: Journal
    progress: Progress


def measure(
    protocol_file: Path,
    station_name: str | None,
    output: Path | None,
    say: Say,
    panel: PanelOptions | None = None,
    speed: float | None = None,
) -> Path:
    """Carries out a protocol on its station and returns the data set's path.

    `panel`: serve the operator's page; `speed`: of an emulated station, instead of its file's.
    Raises InputError before any device is opened; DeviceError, MeasurementStopped or
    KeyboardInterrupt after the data so far have been written.
    """
    protocol = load_protocol(protocol_file)
    station = station_for(protocol_file, protocol.station, station_name)
    if speed is not None:
        station = _at_speed(station, speed)
    planned = plan(protocol, station)  # refuses loads that joints, laser or dynamometer can't take
    path = output or default_output(protocol_file)
    _check_output(path)
    for warning in planned.warnings:
        say(f"Warning: {warning}")
    start: dict[str, object] = {
        "uuid": str(uuid.uuid4()),
        "origin": "emulated" if station.emulation else "measured",
        "title": protocol.title,
        "software": software_version(),
        "protocol": protocol.text,
        "station": station.text,
        "meta": measured_meta(protocol, station).model_dump_json(indent=2, exclude_none=True),
    }
    if speed is not None:  # the station's text says another one
        start["speed"] = speed
    # The devices come first: a run that never began leaves no file behind.
    with speed_named(_speed(station)), _opened(protocol, station, Progress(), say, panel) as rig:
        start["created"] = datetime.now().astimezone().isoformat(timespec="seconds")
        journal = Journal.create(journal_path(path), start, _synced(station))
        return _carry_out(Job(path, protocol, station, journal, Progress()), rig, say)


def resume(
    path: Path, say: Say, panel: PanelOptions | None = None, speed: float | None = None
) -> Path:
    """Goes on with an interrupted measurement, with the repetition in which it stopped."""
    journal_file = journal_path(path)
    if not journal_file.exists():
        hint = "A complete measurement needs no resuming; measure again for another data set."
        if not path.exists():
            hint = "Nor is that file there; give the name that the measurement writes to."
        raise InputError(
            f"{path}: there is no {journal_file.name} beside it, so there is nothing to resume. "
            f"{hint}"
        )
    records = replay(journal_file)
    last = records[-1]
    if last.kind == "stop" and last.data["complete"]:  # its file alone could not be written
        datasets.finish(path)
        return path
    start = records[0].data
    protocol = parse_protocol(start["protocol"], path)
    station = parse_station(start["station"], path)
    speed = speed or start.get("speed")
    if speed is not None:
        station = _at_speed(station, speed)
    progress = read_progress(records)
    # The journal comes first: devices with which another measurement is busy are left alone.
    with (
        Journal.reopen(journal_file, _synced(station)) as journal,
        speed_named(_speed(station)),
        _opened(protocol, station, progress, say, panel) as rig,
    ):
        for record in records:  # the page shows the whole run, not only what is still to come
            rig.onlooker.record(record.kind, record.data)
        journal.append("event", resumed(start["created"], progress, emulated=rig.emulated))
        return _carry_out(Job(path, protocol, station, journal, progress), rig, say)


def _synced(station: Station) -> bool:
    """Whether rows wait for the disk: always, but where the clock runs ahead of real time."""
    return _speed(station) <= 1


def _speed(station: Station) -> float:
    """Times real time."""
    return 1.0 if station.emulation is None else station.emulation.speed


def default_output(protocol_file: Path) -> Path:
    """Beside where the command runs: protocol's name and local time."""
    return Path(f"{protocol_file.stem}_{datetime.now():%Y%m%d-%H%M%S}.h5")


def _check_output(path: Path) -> None:
    check_ending(path)
    if path.exists() or journal_path(path).exists():
        raise InputError(
            f"{path}: exists already, and measurements are never overwritten. "
            "Choose another name with -o, or go on with an interrupted one by --resume."
        )
    check_folder(path)
    check_writable(path)


@dataclass(frozen=True)
class _Rig:
    """Open devices and operator, as a station made them."""

    station: Station
    devices: Devices
    loader: Loader
    clock: Clock
    onlooker: Onlooker

    @property
    def emulated(self) -> bool:
        """Whether nothing here is real."""
        return self.station.emulation is not None


@contextmanager
def _opened(
    protocol: MeasurementProtocol,
    station: Station,
    progress: Progress,
    say: Say,
    panel: PanelOptions | None,
) -> Iterator[_Rig]:
    """Everything that the procedure talks to; closed again in any case."""
    with ExitStack() as stack:
        onlooker = stack.enter_context(_watched(protocol, station, say, panel))
        if station.emulation is not None:
            say("EMULATED station: whatever is measured here is no measurement of a real arm.")
            station = stack.enter_context(emulated_rig(station, protocol, progress.segment))
        clock = station_clock(station)
        devices = make_devices(station, clock)
        open_devices(devices, stack, say, onlooker.device)
        refuse_emulators(station, devices)
        loader = make_loader(station, clock)
        scripted = station.operator.driver == "scripted"
        if scripted:
            loader = LoaderWithBar(loader, protocol, progress.done_steps)
            say(_NO_HAND if panel is None else _PAGE_ALONE)
        loader = onlooker.operator(loader, clock, scripted=scripted)
        stack.callback(loader.close)
        if progress.rows:
            say(f"resuming after {counted(progress.rows, 'row')}")
        if words := interrupted(protocol, progress):
            say(words)
        say(SAFETY_NOTE)
        loader.open()  # from here on the screen moves, and what is said would be painted over
        yield _Rig(station, devices, loader, clock, onlooker)


_NO_HAND = (
    "A script turns the screw and answers every question; no keys are heard. Ctrl-C ends the "
    "measurement; for buttons: --panel."
)
_PAGE_ALONE = (
    "A script turns the screw; the page's buttons are heard, keys in this terminal are not."
)


@contextmanager
def _watched(
    protocol: MeasurementProtocol, station: Station, say: Say, options: PanelOptions | None
) -> Iterator[Onlooker]:
    """Whoever looks on; is told how the measurement ended once its data are written."""
    if options is None:
        yield Onlooker()
        return
    from rig.panel.panel import start_panel

    onlooker = start_panel(protocol, station, options, say)
    phase, text = "aborted", "the measurement was ended"
    try:
        yield onlooker
        phase, text = "done", "all runs done"
    except (MeasurementStopped, InputError) as stop:
        text = str(stop)
        raise
    except DeviceError as error:
        onlooker.device(error.device, error)
        phase, text = "fault", str(error)
        raise
    finally:
        onlooker.finish(phase, text)


def _at_speed(station: Station, speed: float) -> Station:
    if station.emulation is None:
        raise InputError(
            f"--speed {speed:g}: {station.path} is no emulated station, and real time has one "
            "speed. Leave --speed out, or take --station emulated."
        )
    return replace(station, emulation=replace(station.emulation, speed=speed))


def emulated_rig(station: Station, protocol: MeasurementProtocol, before: int = 0) -> EmulatedRig:
    """The emulators of a station, prepared for a protocol: its poses, programs and tools; before:
    segments that were measured before the run was taken up again."""
    poses = {name: tuple(pose.q_rad) for name, pose in protocol.poses.items()}
    programs = {p.program: tuple(p.q_rad) for p in protocol.poses.values() if p.program}
    tools_mm = {name: tuple(pose.tcp_xyz_mm) for name, pose in protocol.poses.items()}
    return EmulatedRig(station, poses, programs, tools_mm, protocol.zero.after_s, before)


def _carry_out(job: Job, rig: _Rig, say: Say) -> Path:
    rate_Hz, progress = job.protocol.sampling.rate_Hz, job.progress
    acquisition = Acquisition(rig.devices, rig.clock, rate_Hz, progress.session_s)
    sign = rig.station.laser.sign if rig.station.laser else 1
    pace = Pace(rig.clock.speed, lambda text: rig.loader.notify(text, "warning"))

    def listen(kind: str, data: Mapping[str, Any]) -> None:
        rig.onlooker.record(kind, data)
        pace.record(kind, data)

    recorder = Recorder(job.journal, rig.devices, acquisition.now, sign, progress.rows, listen)
    runner = Runner(job.protocol, acquisition, rig.loader, recorder, progress, lambda: _build(job))
    reason, complete = "a bug", False
    try:
        job.journal.append("descriptor", _descriptor(rig))
        with _signals(runner.interrupt, _end):
            runner.run()
        reason, complete = "all runs done", True
    except MeasurementStopped as stop:
        reason = str(stop)
        raise
    except DeviceError as error:
        reason = str(error)
        recorder.event("device_failed", reason, device=error.device)
        rig.loader.notify(failed(error), "error")
        raise
    except KeyboardInterrupt:
        reason = "interrupted"
        rig.loader.close()  # else the screen, when it goes, takes this with it
        say(f"Interrupted. {UNLOAD}")
        raise
    finally:
        rig.loader.close()  # what is said from here on must not be painted over
        with _signals(_patience(say), _patience(say)):
            behind = pace.text()
            _finish(job, recorder, reason, say, behind, complete=complete)
        if behind is not None:
            say(behind)
    return job.output


def _descriptor(rig: _Rig) -> dict[str, object]:
    """Who measures what: identities, calibration, and the columns that the devices deliver."""
    devices = {device.name: dict(device.identity()) for device in rig.devices.all()}
    columns = [asdict(signal) for device in rig.devices.all() for signal in device.signals]
    operator = {rig.loader.name: dict(rig.loader.identity())}
    if rig.station.emulation is not None:
        operator[rig.loader.name]["clock"] = f"{rig.station.emulation.speed:g} times real time"
    settings = {"dynamometer": rig.station.dynamometer, "laser": rig.station.laser}
    calibration = {name: asdict(each) for name, each in settings.items() if each is not None}
    return {"devices": devices | operator, "signals": columns, "calibration": calibration}


def _finish(
    job: Job, recorder: Recorder, reason: str, say: Say, behind: str | None, *, complete: bool
) -> None:
    """Stop record and data set; the journal goes when that is complete and has been read back.
    behind: that the machine could not keep up."""
    with suppress(JournalError):  # a disk that refuses has been reported; what it holds counts
        if behind is not None:
            recorder.event("behind", behind)
        if complete:
            recorder.stop(reason, complete=True)
        else:
            recorder.event("stopped", reason)
    job.journal.close()
    try:
        stored = datasets.finish(job.output)
    except InputError as error:
        kept = (
            f"What was measured is kept in {journal_path(job.output)}. To go on once that is "
            f"mended: rig measure --resume {job.output}"
        )
        if complete:
            raise InputError(f"{error} {kept}") from error
        say(f"{error} {kept}")  # and then why the measurement ended
        return
    if not stored.complete:
        say(f"{counted(stored.rows, 'row')} kept. To go on: rig measure --resume {job.output}")


def _build(job: Job) -> None:
    """Brings the data set up to date; the journal goes on."""
    records = replay(journal_path(job.output))
    try:
        datasets.write(datasets.from_records(records, job.output), job.output)
    except InputError as error:  # a full disk, say: the journal would be next
        raise MeasurementStopped(f"{error} {UNLOAD}") from error


@contextmanager
def _signals(on_ctrl_c: Callable[[], object], on_end: Callable[[], object]) -> Iterator[None]:
    """Ctrl-C and the wish to end (SIGTERM, a terminal that is closed) for the time of the
    measurement."""
    wishes = {signal.SIGINT: on_ctrl_c, signal.SIGTERM: on_end}
    hangup = getattr(signal, "SIGHUP", None)  # Windows has none
    if hangup is not None and signal.getsignal(hangup) is not signal.SIG_IGN:  # as nohup asks
        wishes[hangup] = on_end

    def handler(number: int, _frame: FrameType | None) -> None:
        if number == hangup:
            signal.signal(number, signal.SIG_IGN)  # shell and kernel say it once more each
            leave_lost_terminal()
        wishes[signal.Signals(number)]()

    earlier = {number: signal.signal(number, handler) for number in wishes}
    try:
        yield
    finally:
        for number, was in earlier.items():
            if signal.getsignal(number) is handler:
                signal.signal(number, was)


def _patience(say: Say) -> Callable[[], None]:
    return lambda: say("writing the data set; this takes a moment")


def _end() -> None:
    raise KeyboardInterrupt
