"""The emulated controller's two ports: RTDE and Dashboard, in threads of this process."""

from __future__ import annotations

import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from drivers.ur10e import rtde, words
from drivers.ur10e.emulated_controller import Controller

_BEAT_S = 0.02  # how soon a session notices a fault or the end
CONTROLLER_VERSION = (5, 12, 2, 1101534)
POLYSCOPE = "URSoftware 5.12.2.1101534 (Jul 06 2022)"
MODEL = "UR10"
SERIAL_NUMBER = "0000000000-EMULATED"
GREETING = "Connected: Universal Robots Dashboard Server"


class Line:
    """Faults of the connection, shared by listeners and sessions."""

    def __init__(self, seed: int) -> None:
        self.faults: set[str] = set()
        self.stopping = threading.Event()
        self._random = np.random.default_rng(seed)

    def broken(self) -> bool:
        """Whether sessions must end now."""
        return self.stopping.is_set() or not self.faults.isdisjoint({"close", "refuse"})

    def spoil(self, message: bytes) -> bytes:
        """The bytes that really go out in place of `message`."""
        if "garbage" in self.faults:
            return self._random.bytes(max(8, len(message)))
        if "bad_size" in self.faults:
            return rtde.HEADER.pack(rtde.HEADER.size - 1, message[2]) + message[3:]
        return message


class Listener:
    """Accepts clients on one port and gives each a session in a thread of its own."""

    def __init__(
        self, port_socket: socket.socket, line: Line, session: Callable[[socket.socket], None]
    ) -> None:
        self._socket = port_socket
        self._line = line
        self._session = session
        self._threads: list[threading.Thread] = []
        self._thread = threading.Thread(target=self._accept, name="ur10e listener", daemon=True)
        self._thread.start()

    def await_refusal(self) -> None:
        """Returns when the port is closed, after the line has been told to refuse."""
        self._thread.join(2.0)

    def join(self) -> None:
        """Waits until listener and sessions have ended; they have been told to by `line`."""
        for thread in (self._thread, *self._threads):
            thread.join(2.0)

    def _accept(self) -> None:
        while not self._line.stopping.is_set() and "refuse" not in self._line.faults:
            readable, _, _ = select.select([self._socket], [], [], _BEAT_S)
            if not readable:
                continue
            try:
                client, _ = self._socket.accept()
            except OSError:
                break
            self._threads = [t for t in self._threads if t.is_alive()]
            thread = threading.Thread(target=self._serve, args=(client,), daemon=True)
            self._threads.append(thread)
            thread.start()
        self._socket.close()

    def _serve(self, client: socket.socket) -> None:
        with client, suppress(OSError):  # a client that leaves in the middle is no fault of ours
            client.settimeout(2.0)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._session(client)


class RtdeSession:
    """One RTDE client: answers its requests, then sends data at its rate."""

    def __init__(
        self,
        client: socket.socket,
        controller: Controller,
        line: Line,
        frequency_Hz: float,
        speed: float,
        max_rate_Hz: float,
    ) -> None:
        self._client = client
        self._controller = controller
        self._line = line
        self._frequency_Hz = frequency_Hz
        self._speed = speed
        self._max_rate_Hz = max_rate_Hz
        self._period_s = 1.0
        self._names: list[str] = []
        self._layout = rtde.package(())
        self._next: float | None = None  # when data is due, time.monotonic(); None: not started

    def run(self) -> None:
        """Until the client leaves or the emulator ends."""
        frames = rtde.Frames()
        while not self._line.broken():
            now = time.monotonic()
            wait = _BEAT_S if self._next is None else min(_BEAT_S, max(0.0, self._next - now))
            readable, _, _ = select.select([self._client], [], [], wait)
            if readable:
                data = self._client.recv(65536)
                if not data:
                    return
                try:
                    messages = frames.feed(data)
                except rtde.FormatError:
                    return
                for kind, payload in messages:
                    self._answer(kind, payload)
            if self._next is not None and time.monotonic() >= self._next:
                self._send_data()

    def _answer(self, kind: int, payload: bytes) -> None:
        if kind == rtde.PROTOCOL:
            wanted = struct.unpack(">H", payload)[0]
            good = wanted == rtde.PROTOCOL_VERSION and "wrong_version" not in self._line.faults
            self._send(kind, bytes([good]))
        elif kind == rtde.CONTROLLER:
            self._send(kind, struct.pack(">4I", *CONTROLLER_VERSION))
        elif kind == rtde.OUTPUTS:
            self._send(kind, self._recipe(payload))
        elif kind == rtde.INPUTS:
            names = [name for name in payload.decode().split(",") if name]
            self._send(kind, b"\x00" + ",".join("NOT_FOUND" for _ in names).encode())
        elif kind == rtde.START:
            self._send(kind, bytes([bool(self._names)]))
            if self._names and "slow_start" not in self._line.faults:
                self._next = time.monotonic()
        elif kind == rtde.PAUSE:
            self._next = None
            self._send(kind, b"\x01")

    def _recipe(self, payload: bytes) -> bytes:
        """Recipe number and types; a number of 0 and NOT_FOUND for what is not simulated."""
        frequency = struct.unpack_from(">d", payload)[0]
        names = [name for name in payload[8:].decode().split(",") if name]
        types = [rtde.VARIABLES.get(name, "NOT_FOUND") for name in names]
        known = "NOT_FOUND" not in types
        if known:
            self._names, self._layout = names, rtde.package(types)
            frequency = min(self._frequency_Hz, max(1.0, frequency))
            self._period_s = 1 / min(self._max_rate_Hz, frequency * self._speed)
        return bytes([known]) + ",".join(types).encode()

    def _send_data(self) -> None:
        if self._next is None:
            return
        values = self._controller.values()
        row = [value for name in self._names for value in values[name]]
        self._send(rtde.DATA, self._layout.pack(1, *row))
        # Whoever is late does not catch up with a burst: a controller's values are of now.
        self._next = max(self._next + self._period_s, time.monotonic())

    def _send(self, kind: int, payload: bytes) -> None:
        if "silence" not in self._line.faults:
            self._client.sendall(self._line.spoil(rtde.frame(kind, payload)))


class DashboardSession:
    """One Dashboard client: a line in, a line out."""

    def __init__(self, client: socket.socket, controller: Controller, line: Line) -> None:
        self._client = client
        self._controller = controller
        self._line = line

    def run(self) -> None:
        """Until the client leaves or the emulator ends."""
        if self._line.broken():
            return
        self._say(GREETING)
        rest = b""
        while not self._line.broken():
            readable, _, _ = select.select([self._client], [], [], _BEAT_S)
            if not readable:
                continue
            data = self._client.recv(4096)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                command = line.decode("utf-8", "replace").strip()
                self._say(self._reply(command))
                if command == "quit":
                    return

    def _say(self, text: str) -> None:
        if "silence" in self._line.faults:
            return
        data = text.encode() + b"\n"
        if "garbage" in self._line.faults:
            data = self._line.spoil(data)
        self._client.sendall(data)

    def _reply(self, command: str) -> str:
        controller = self._controller
        controller.commands.append(command)
        word, _, argument = command.partition(" ")
        if word == "load":
            if controller.load(argument):
                return f"Loading program: /programs/{argument}"
            return f"File not found: {argument}"
        if word == "play":
            return "Starting program" if controller.play() else "Failed to execute: play"
        if word == "stop":
            controller.stop()
            return "Stopped"
        return self._facts().get(command, f"could not understand: '{command}'")

    def _facts(self) -> dict[str, str]:
        modes, loaded = self._controller.modes, self._controller.loaded
        playing = modes.runtime_state == words.PLAYING
        safety = _capitals(words.SAFETY_MODES[modes.safety_mode])
        states = {words.PLAYING: "PLAYING", words.PAUSED: "PAUSED"}
        robot = "RUNNING" if modes.robot_mode == words.RUNNING else "POWER_OFF"
        return {
            "robotmode": f"Robotmode: {robot}",
            "safetystatus": f"Safetystatus: {safety}",
            "safetymode": f"Safetymode: {safety}",
            "running": f"Program running: {str(playing).lower()}",
            "programState": f"{states.get(modes.runtime_state, 'STOPPED')} {loaded}",
            "get loaded program": f"Loaded program: /programs/{loaded}",
            "get robot model": MODEL,
            "get serial number": SERIAL_NUMBER,
            "PolyscopeVersion": POLYSCOPE,
            # The emulated arm is switched on already, and no stop of it is ever released.
            "power on": "Powering on",
            "brake release": "Brake releasing",
            "is in remote control": "true",
            "quit": "Disconnected",
        }


def _capitals(words_: str) -> str:
    return words_.upper().replace(" ", "_").replace("-", "_")
