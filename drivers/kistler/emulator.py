"""A stand-in for dynamometer, amplifier and DAQ: NI's gRPC device server on loopback.

The real `nidaqmx` talks to it with the calls and bytes that it would send to NI's own server.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from drivers.arrays import Array

os.environ.setdefault("GRPC_VERBOSITY", "NONE")

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as messages
from nidaqmx._stubs import nidaqmx_pb2_grpc as stubs

from drivers.kistler.chain import ChargeChain
from drivers.kistler.listener import RawListener
from drivers.kistler.service import NiError, Tasks, TaskService
from drivers.kistler.settings import KistlerSettings
from drivers.scene import Scene

# Raised by every call that touches the device; the others only by reads.
_DEVICE_CODES = {"unplugged": -201003, "unknown_device": -200220, "aborted": -50405}
_READ_CODES = {"overwritten": -200279, "fifo_overflow": -200361}
_RAW = {"close": "close", "mute": "mute", "wrong_server": "chatter", "refuse": None}


class KistlerEmulator:
    """Meets `drivers.emulation.Emulator`; `settings.grpc_server` does not matter to it.

    Sample i of a task is what the scene shows at t0 + i / rate on the scene's clock. The load acts
    at the az0 point over the sensor's centre: moments about it are noise.
    """

    faults: Mapping[str, str] = {
        "silence": "calls are accepted and never answered",
        "mute": "connections are accepted, no byte ever comes",
        "close": "connections are closed, new ones too",
        "refuse": "nothing listens any more",
        "wrong_server": "the port answers in another protocol",
        "garbage": "replies are bytes that cannot be decoded",
        "nonsense": "replies have the right form and impossible values",
        "short_reply": "reads give fewer samples than asked",
        "long_reply": "reads give more samples than asked",
        "unplugged": "error -201003: the device is not accessible",
        "unknown_device": "error -200220: there is no such device",
        "aborted": "error -50405: the transfer was aborted, as by replugging",
        "overwritten": "error -200279: samples were overwritten before they were read",
        "fifo_overflow": "error -200361: the device's FIFO overflowed",
        "no_samples": "error -200284: the sample clock stands",
        "overload": "channel 1 saturates whenever the amplifier operates",
        "no_reset": "the Reset line has no effect",
    }
    does_not_simulate = (
        "crosstalk between the axes (an option, off by default), nonlinearity and hysteresis of the"
        " crystals, curved charge drift, temperature, the amplifier's filters, 1/f noise,"
        " moments of a load beside the sensor's axis, triggers, other DAQ tasks"
    )

    def __init__(
        self, scene: Scene, settings: KistlerSettings, seed: int, crosstalk: float = 0.0
    ) -> None:
        """`crosstalk`: 0 to 1, part of every force component that the two others show."""
        self._scene = scene
        self._settings = settings
        self._lock = threading.Lock()
        self._chain = ChargeChain(settings, scene.force_N, scene.now(), seed, crosstalk)
        self._fault: str | None = None
        self._server: grpc.Server | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._raw: RawListener | None = None
        self._port = 0
        self._stopping = threading.Event()
        self.tasks = Tasks(self, settings)
        self.calls: list[str] = []  # names of the calls other than reads, for tests

    def start(self) -> str:
        """Serves on a free loopback port; returns address:port."""
        self._stopping.clear()
        self._pool = ThreadPoolExecutor(max_workers=8, thread_name_prefix="kistler-emulator")
        self._server = grpc.server(
            self._pool,
            interceptors=[_Gate(self._before, self._serialize)],
            options=[("grpc.so_reuseport", 0), ("grpc.max_receive_message_length", -1)],
        )
        stubs.add_NiDAQmxServicer_to_server(TaskService(self.tasks), self._server)
        self._port = self._server.add_insecure_port("127.0.0.1:0")
        self._server.start()
        if self._fault in _RAW:
            self._go_raw(_RAW[self._fault])
        return f"127.0.0.1:{self._port}"

    def stop(self) -> None:
        """Ends all threads; may be called twice."""
        self._stopping.set()
        self._stop_server()
        if self._raw is not None:
            self._raw.stop()
            self._raw = None

    def inject(self, fault: str) -> None:
        """Shows the fault from now on; raises ValueError for one that `faults` does not list."""
        if fault not in self.faults:
            known = ", ".join(sorted(self.faults))
            raise ValueError(f'the dynamometer\'s emulator has no fault "{fault}"; known: {known}')
        self._fault = fault
        if fault == "overload":
            with self._lock:
                self._chain.leak(0)
        if fault in _RAW and self._server is not None:
            self._go_raw(_RAW[fault])

    @property
    def drift_N_per_s(self) -> Array:
        """True drift (channels,) since the last Operate, in N/s of the single channels."""
        with self._lock:
            return self._chain.drift_N_per_s

    # ------------------------------------------------------------------ what the tasks ask for

    def now(self) -> float:
        """Seconds of the scene's clock: the DAQ's sample clock."""
        return self._scene.now()

    def wait_until(self, when: float, timeout_s: float, alive: Callable[[], bool]) -> bool:
        """Waits for `when` on the scene's clock; False at stop or after `timeout_s` (wall)."""
        left = timeout_s
        while (remaining := (when - self._scene.now()) / self._scene.speed) > 0:
            pause = min(remaining, left, 0.05)
            if pause <= 0 or not alive() or self._stopping.wait(pause):
                return False
            left -= pause
        return True

    def volts(self, t: Array, low: float, high: float) -> Array:
        """Volts (n, channels) at the converter."""
        with self._lock:
            return self._chain.volts(t, low, high)

    def drive_line(self, high: bool) -> None:
        """The Reset/Operate line is set."""
        if self._fault != "no_reset":
            self.turn_switch(reset=high == self._settings.reset_active_high)

    def turn_switch(self, *, reset: bool) -> None:
        """The amplifier's own switch is turned, as by hand where there is no line."""
        with self._lock:
            self._chain.switch(self._scene.now(), operate=not reset)

    # ------------------------------------------------------------------ faults

    def _before(self, call: str, context: Any) -> None:
        """Runs ahead of every call; raises NiError, or blocks, as the fault demands."""
        reading = call == "ReadAnalogF64"
        if not reading:
            self.calls.append(call)
        if self._fault == "silence" or (reading and self._fault == "no_samples"):
            limit = math.inf if self._fault == "silence" else 0.2
            self.wait_until(math.inf, limit, context.is_active)
            raise NiError(-200284, "Some or all of the samples requested have not been acquired.")
        touches = not call.startswith(("GetSystem", "CreateTask", "GetTask", "ClearTask"))
        if self._fault in _DEVICE_CODES and touches:
            raise NiError(_DEVICE_CODES[self._fault], "The device failed as the test asked.")
        if self._fault in _READ_CODES and reading:
            raise NiError(_READ_CODES[self._fault], "The read failed as the test asked.")

    def _serialize(self, reply: Any) -> bytes:
        if self._fault == "garbage":
            return b"\xff\xff\xff\xff garbage"
        if isinstance(reply, messages.ReadAnalogF64Response):
            if self._fault == "nonsense":
                reply.read_array[:] = [1e30] * len(reply.read_array)
            elif self._fault == "short_reply":
                reply.samps_per_chan_read -= 1
            elif self._fault == "long_reply":
                reply.read_array.append(0.0)
        data: bytes = reply.SerializeToString()
        return data

    def _go_raw(self, behaviour: str | None) -> None:
        self._stop_server()
        if behaviour is not None:
            self._raw = RawListener(self._port, behaviour)

    def _stop_server(self) -> None:
        server, self._server = self._server, None
        pool, self._pool = self._pool, None
        if server is not None:
            server.stop(0).wait(2.0)
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)


class _Gate(grpc.ServerInterceptor):  # type: ignore[type-arg]
    """Puts the fault ahead of every call and between every reply and the wire."""

    def __init__(
        self, before: Callable[[str, Any], None], serialize: Callable[[Any], bytes]
    ) -> None:
        self._before = before
        self._serialize = serialize

    def intercept_service(
        self, continuation: Callable[[Any], Any], handler_call_details: Any
    ) -> Any:
        handler = continuation(handler_call_details)
        if handler is None or handler.unary_unary is None:
            return handler
        call = handler_call_details.method.rpartition("/")[2]

        def answer(request: Any, context: Any) -> Any:
            try:
                self._before(call, context)
                return handler.unary_unary(request, context)
            except NiError as error:
                context.set_trailing_metadata((("ni-error", str(error.code)),))
                context.abort(grpc.StatusCode.UNKNOWN, str(error))

        return grpc.unary_unary_rpc_method_handler(
            answer,
            request_deserializer=handler.request_deserializer,
            response_serializer=self._serialize,
        )
