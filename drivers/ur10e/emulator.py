"""A UR10e's controller on loopback: the real bytes of RTDE and Dashboard, for the real client."""

from __future__ import annotations

import itertools
import os
import socket
from collections.abc import Mapping, Sequence

from drivers.scene import Scene
from drivers.ur10e import dashboard, rtde
from drivers.ur10e.emulated_controller import Controller
from drivers.ur10e.emulated_servers import DashboardSession, Line, Listener, RtdeSession

MAX_RATE_HZ = 250.0  # messages per wall second, however fast the scene
_counter = itertools.count()

FAULTS: Mapping[str, str] = {
    "silence": "both ports accept connections and send nothing more",
    "close": "both ports close every connection, at once and as soon as it is made",
    "refuse": "connections are closed and new ones refused, as after a power cut",
    "garbage": "random bytes go out in place of every message",
    "bad_size": "every RTDE message claims a size smaller than its own header",
    "wrong_version": "the protocol version is not accepted; shows to whoever connects from now on",
    "frozen_timestamp": "data goes on, but the controller's timestamp stands still",
    "slow_start": "the start is confirmed and no data follows, for whoever connects from now on",
    "protective_stop": "the arm is in a protective stop, its program paused",
    "emergency_stop": "the robot's emergency stop is pressed, the arm without power",
    "program_stopped": "the program that was playing stops; an event, so nothing shows of it to "
    "whoever connects later",
    "joint_deviation": "joint 1 reads 10 deg beside its commanded position",
    "hot_joint": "joint 3 reads 85 deg C",
}


class Ur10eEmulator:
    """Meets `drivers.emulation.Emulator`.

    programs: name -> q (6) rad, what `load` and `play` of the Dashboard can move the arm to.
    Timestamps are seconds of the scene; messages come at `frequency_Hz` times its speed, or less
    where the client asks for less, and never above 250 a wall-clock second. `host` None: an unused
    address of 127.0.0.0/8.
    """

    faults = FAULTS
    does_not_simulate = (
        "RTDE inputs, output variables beyond the twelve that are read, several recipes, real-time "
        "jitter; dynamics, collisions, torque limits and safety functions; local and remote "
        "control; power, brakes and the release of a stop by the pendant"
    )

    def __init__(
        self,
        scene: Scene,
        host: str | None = None,
        programs: Mapping[str, Sequence[float]] | None = None,
        frequency_Hz: float = 125.0,
        seed: int = 0,
        programs_end: bool = False,
    ) -> None:
        self._scene = scene
        self._host = host
        self._frequency_Hz = frequency_Hz
        self._controller = Controller(scene, programs or {}, seed, programs_end)
        self._line = Line(seed)
        self._listeners: list[Listener] = []

    def start(self) -> str:
        """Starts serving; returns the host. OSError if it is taken or does not exist."""
        rtde_socket, dashboard_socket, host = self._bind()
        self._listeners = [
            Listener(rtde_socket, self._line, self._serve_rtde),
            Listener(dashboard_socket, self._line, self._serve_dashboard),
        ]
        self._await_refusal()
        return host

    def _await_refusal(self) -> None:
        if "refuse" in self._line.faults:
            for listener in self._listeners:
                listener.await_refusal()

    def stop(self) -> None:
        """Ends every connection and thread; may be called twice."""
        self._line.stopping.set()
        for listener in self._listeners:
            listener.join()

    @property
    def commands(self) -> tuple[str, ...]:
        """What the Dashboard server was told so far, at most the last thousand lines."""
        return tuple(self._controller.commands)

    def inject(self, fault: str) -> None:
        """Shows the fault from now on; ValueError for an unknown one."""
        if fault not in FAULTS:
            raise ValueError(f'no fault "{fault}"; known: {", ".join(sorted(FAULTS))}')
        self._controller.fault(fault)
        self._line.faults.add(fault)
        self._await_refusal()

    def _serve_rtde(self, client: socket.socket) -> None:
        RtdeSession(
            client, self._controller, self._line, self._frequency_Hz, self._scene.speed, MAX_RATE_HZ
        ).run()

    def _serve_dashboard(self, client: socket.socket) -> None:
        DashboardSession(client, self._controller, self._line).run()

    def _bind(self) -> tuple[socket.socket, socket.socket, str]:
        if self._host is not None:
            return (*_listen(self._host), self._host)
        last: OSError | None = None
        for _ in range(64):
            host = _candidate(next(_counter))
            try:
                return (*_listen(host), host)
            except OSError as error:
                last = error
        raise OSError(
            f"no address of 127.0.0.0/8 has its ports {rtde.PORT} and {dashboard.PORT} free "
            f"({last}); on systems other than Linux such addresses must be set up first"
        )


def _candidate(count: int) -> str:
    """An address that no other emulator of this or another process is likely to try first."""
    pid = os.getpid()
    return f"127.{64 + (pid >> 16) % 64}.{(pid >> 8) % 256}.{1 + (pid + 61 * count) % 254}"


def _listen(host: str) -> tuple[socket.socket, socket.socket]:
    sockets: list[socket.socket] = []
    try:
        for port in (rtde.PORT, dashboard.PORT):
            sockets.append(socket.create_server((host, port)))
    except OSError:
        for opened in sockets:
            opened.close()
        raise
    return sockets[0], sockets[1]
