"""The emulated rig: a child process holds the world and all emulators of a station.

The measuring process and the emulators share nothing but sockets and a pseudo terminal, as with
hardware. The child ends when told to, on SIGTERM, and when its standard input closes: also when
the measuring process was killed. `python -m rig.emulation.emulated` is that child; by hand it
takes `STATION.yaml [PROTOCOL.yaml]`.

Messages are one JSON object a line. In: the rig to emulate, then {"fault": {"device", "kind"}} or
{"quit": true}. Out: {"endpoints": {device: address}}, then {"ok": true}; or {"error": text,
"input": whether the user can mend it}.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import textwrap
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from drivers.errors import CannotConnect, DeviceError
from rig.child_process import ChildProcess
from rig.emulation.child import ENDING_S, Child
from rig.errors import InputError
from rig.units import M_PER_MM

if TYPE_CHECKING:
    from rig.emulation.host import EmulationHost
    from rig.station import Station

Poses = Mapping[str, Sequence[float]]
REMEDY = "Start the measurement again; if it fails again, look at `rig emulate`."
ANSWER_S = 5.0


class EmulatedRig:
    """The emulators of a station, seen from the measuring process; a context manager.

    `poses`: joint angles (6) rad by name, the arm stands in the first; `programs`: joint angles
    by the name of the program on the controller; `tools_mm`: loaded point in the flange frame (3)
    by pose, the flange itself where there is none; `zero_after_s`: the zero plateau after a run;
    `before`: how often the force was tared before a run was taken up again, so that what scatters
    from one loading to the next does not begin anew.
    """

    def __init__(
        self,
        station: Station,
        poses: Poses | None = None,
        programs: Poses | None = None,
        tools_mm: Poses | None = None,
        zero_after_s: float = 6.0,
        before: int = 0,
    ) -> None:
        self._station = station
        tools = tools_mm or {}
        self._procedure = {
            "poses": [
                (list(q), [M_PER_MM * mm for mm in tools.get(name, (0.0, 0.0, 0.0))])
                for name, q in (poses or {}).items()
            ],
            "programs": {name: list(q) for name, q in (programs or {}).items()},
            "zero_after_s": zero_after_s,
            "before": before,
        }
        self._child: ChildProcess | None = None
        self._lines: _Lines | None = None

    def start(self, deadline_s: float = 20.0) -> Station:
        """Starts the child; returns the station with every "emulated" replaced by an address.

        InputError for an unknown world or fault, CannotConnect when the emulators don't start.
        """
        from pydantic import TypeAdapter

        from rig.station import Station as StationType

        self._spawn()
        settings = {
            "station": TypeAdapter(StationType).dump_python(self._station, mode="json"),
            "procedure": self._procedure,
        }
        try:
            endpoints = self._ask(settings, deadline_s)["endpoints"]
        except BaseException:
            self.stop()
            raise
        return _with_endpoints(self._station, endpoints)

    def fault(self, device: str, kind: str) -> None:
        """robot, dynamometer or laser shows the fault from now on; InputError if unknown."""
        self._ask({"fault": {"device": device, "kind": kind}}, ANSWER_S)

    def stop(self) -> None:
        """Ends the child, by force if need be; may be called twice."""
        child, self._child = self._child, None
        if child is None:
            return
        child.close_input()  # tells it to end
        if not child.ended_within(ENDING_S + 1.0):
            child.kill()
        child.close()

    def __enter__(self) -> Station:
        return self.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    @property
    def pid(self) -> int | None:
        """Of the child; None when there is none."""
        return None if self._child is None else self._child.pid

    def _spawn(self) -> None:
        if self._child is not None:
            raise RuntimeError("the emulated rig is running already")
        self._child = ChildProcess("rig.emulation.emulated")
        self._lines = _Lines(self._child.output.fileno())

    def _ask(self, message: Mapping[str, Any], deadline_s: float) -> dict[str, Any]:
        if self._child is None or self._lines is None:
            raise RuntimeError("the emulated rig is not running")
        try:
            self._child.send(json.dumps(message).encode() + b"\n")
            line = self._lines.next(deadline_s)
        except (BrokenPipeError, EOFError):
            raise CannotConnect("emulation", self._how_it_ended(), REMEDY) from None
        if line is None:
            fault = f"the emulators have not answered within {deadline_s:g} s"
            raise CannotConnect("emulation", fault, REMEDY)
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            if answer.get("input"):
                raise InputError(answer["error"])
            raise DeviceError("emulation", answer["error"], REMEDY)
        return answer

    def _how_it_ended(self) -> str:
        assert self._child is not None
        ending = self._child.ending()
        status = "unknown" if ending.status is None else ending.status
        words = f": {ending.line.rstrip('.')}" if ending.line else ""
        return f"the process of the emulators has ended, status {status}{words}"


class _Lines:
    """Lines from a pipe, each awaited until a deadline."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""

    def next(self, deadline_s: float) -> bytes | None:
        """The next line, None after the deadline (s); EOFError when the other end has closed."""
        end = time.monotonic() + deadline_s
        while b"\n" not in self._rest:
            left = end - time.monotonic()
            if left <= 0 or not select.select([self._descriptor], [], [], left)[0]:
                return None
            chunk = os.read(self._descriptor, 65536)
            if not chunk:
                raise EOFError
            self._rest += chunk
        line, self._rest = self._rest.split(b"\n", 1)
        return line


def _with_endpoints(station: Station, endpoints: Mapping[str, str]) -> Station:
    from rig.station import EMULATED, ENDPOINTS

    filled = {
        device: replace(getattr(station, device), **{key: endpoints[device]})
        for device, key in ENDPOINTS
        if getattr(getattr(station, device), key, None) == EMULATED
    }
    return replace(station, **filled)


def serve_by_hand(station: Station) -> None:
    """Runs a station's emulators in the foreground until Ctrl-C, SIGTERM or a "quit" at the
    screw's port; faults are typed as `DEVICE FAULT` or sent there."""
    from rig.emulation.host import EmulationHost

    host = EmulationHost(station)
    over = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    try:
        endpoints = _started(host, over)
        print(_table(host, endpoints), flush=True)
        if sys.stdin.isatty():
            threading.Thread(target=_typed_faults, args=(host,), daemon=True).start()
        while not over.wait(0.2):
            pass
    except KeyboardInterrupt:
        print("\nemulators stopped")
    finally:
        host.stop()


def _started(host: EmulationHost, over: threading.Event) -> dict[str, str]:
    try:
        return host.start(over.set)
    except OSError as error:
        raise CannotConnect(
            "emulation", f"the emulators can't be started: {error}", REMEDY
        ) from None


def _typed_faults(host: EmulationHost) -> None:
    for line in sys.stdin:
        words = line.split()
        if not words:
            continue
        try:
            host.inject(words[0], " ".join(words[1:]))
            print(f"{words[0]} shows {' '.join(words[1:])}", flush=True)
        except InputError as error:
            print(error, flush=True)


def _table(host: EmulationHost, endpoints: Mapping[str, str]) -> str:
    emulation, design = host.emulation, host.scene.world.design
    lines = [
        f"EMULATED station {host.station.name}: world {design.name} ({design.title}),",
        f"seed {emulation.seed}, {emulation.speed:g} times real time",
        *_wrapped("  does not simulate: ", host.scene.does_not_simulate),
        "",
    ]
    for device, emulator in host.emulators.items():
        lines += [
            f"{device:12} {endpoints[device]}",
            *_wrapped("  does not simulate: ", emulator.does_not_simulate),
            "  faults:",
        ]
        for kind, text in emulator.faults.items():
            lines += _wrapped(f"    {kind:20} ", text)
        lines.append("")
    message = '{"fault": {"device": "laser", "kind": "silence"}}'
    lines += [
        f'{"screw":12} {endpoints["operator"]}   one JSON object a line, e.g. {{"turn_mm": 0.1}}',
        "",
        "To inject a fault type its device and name here (laser silence), or send",
        f"{message} to the screw's port. Ctrl-C ends the emulators.",
    ]
    return "\n".join(lines)


def _wrapped(head: str, text: str) -> list[str]:
    """Lines of at most 100 characters, the later ones indented as far as `head` is long."""
    return textwrap.wrap(text, 100, initial_indent=head, subsequent_indent=" " * len(head))


def _settings_of_files(names: Sequence[str]) -> dict[str, Any]:
    """What the parent would send for STATION.yaml [PROTOCOL.yaml]."""
    from pydantic import TypeAdapter

    from rig.protocol import load_protocol
    from rig.station import Station as StationType
    from rig.station import load_station

    station = load_station(names[0])
    procedure: dict[str, Any] = {}
    if len(names) > 1:
        protocol = load_protocol(Path(names[1]))
        poses = protocol.poses.values()
        procedure = {
            "poses": [(p.q_rad, [M_PER_MM * mm for mm in p.tcp_xyz_mm]) for p in poses],
            "programs": {p.program: p.q_rad for p in poses if p.program},
            "zero_after_s": protocol.zero.after_s,
        }
    station_values = TypeAdapter(StationType).dump_python(station, mode="json")
    return {"station": station_values, "procedure": procedure}


def main(arguments: Sequence[str]) -> int:
    """The child process; exit status 2 for bad files given by hand."""
    try:
        first = _settings_of_files(arguments) if arguments else None
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return Child().run(first)


if __name__ == "__main__":
    # gRPC's threads may still be unwinding: leave without waiting for the interpreter's teardown
    STATUS = main(sys.argv[1:])
    sys.stderr.flush()
    os._exit(STATUS)
