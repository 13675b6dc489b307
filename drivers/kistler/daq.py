"""The NI DAQ behind the amplifier: tasks and reads through `nidaqmx`, every call with a deadline.

Local driver or NI's gRPC device server; all that is particular to `nidaqmx` stays in this file.
What its methods raise is in `DAQ_ERRORS`; `drivers.kistler.explain` puts it into words.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from drivers import network
from drivers.arrays import Array
from drivers.errors import CannotConnect
from drivers.kistler.explain import DEVICE, NonsenseReply
from drivers.kistler.settings import KistlerSettings

# gRPC's C core writes to standard error by itself; the operator gets one message, ours.
os.environ.setdefault("GRPC_VERBOSITY", "NONE")

import grpc
import nidaqmx
import nidaqmx.errors
from nidaqmx.constants import AcquisitionType, LineGrouping, TerminalConfiguration
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.system import Device, System

# ValueError: nidaqmx at an enumeration value it does not know, gRPC on a channel that was closed.
DAQ_ERRORS: tuple[type[Exception], ...] = (
    nidaqmx.errors.Error,
    grpc.RpcError,
    NonsenseReply,
    ValueError,
)
IMPLAUSIBLE_V = 11.0  # a -10..10 V input converts a little beyond its range, never so far
BUFFER_S = 10.0
_CLOSE_S = 1.0
_GRPC_MARGIN_S = 0.3
_TERMINALS = {
    "rse": TerminalConfiguration.RSE,
    "nrse": TerminalConfiguration.NRSE,
    "differential": TerminalConfiguration.DIFF,
    "pseudo_differential": TerminalConfiguration.PSEUDO_DIFF,
}


class _Details(NamedTuple):
    method: str
    timeout: float | None
    metadata: Any
    credentials: Any
    wait_for_ready: Any
    compression: Any


class Deadlines(grpc.UnaryUnaryClientInterceptor):  # type: ignore[type-arg]
    """Gives every gRPC call a timeout, because nidaqmx gives them none.

    `each_s` limits a single call, `until` (monotonic clock) all calls together.
    """

    def __init__(self, each_s: float, until: float) -> None:
        self.each_s = each_s
        self.until = until

    def intercept_unary_unary(
        self, continuation: Callable[[Any, Any], Any], client_call_details: Any, request: Any
    ) -> Any:
        """Passes the call on with what is left of the deadline."""
        left = max(0.001, min(self.each_s, self.until - time.monotonic()))
        old = client_call_details
        details = _Details(
            old.method, left, old.metadata, old.credentials, old.wait_for_ready, old.compression
        )
        return continuation(details, request)


class Daq:
    """Analog input of the amplifier's channels and the digital output of its Reset line.

    `speed` is that of the station's clock: a faster scene fills the buffers faster.
    """

    def __init__(self, settings: KistlerSettings, block_s: float, speed: float = 1.0) -> None:
        self._settings = settings
        self._speed = speed
        self.samples = round(settings.sample_rate_Hz * block_s)
        self._buffer = np.empty((settings.channels, self.samples))
        self._channel: grpc.Channel | None = None
        self._deadlines: Deadlines | None = None
        self._input: Any = None
        self._line: Any = None
        self._reader: Any = None
        self._close_once = threading.Lock()

    def open(self, until: float) -> None:
        """Connects, creates the tasks and starts sampling; done or failed by `until`."""
        if self._settings.grpc_server is not None:
            self._connect(self._settings.grpc_server, until)
        self._create_input()
        if self._settings.reset_line is not None:
            self._line = self._task()
            self._line.do_channels.add_do_chan(
                f"{self._settings.device}/{self._settings.reset_line}",
                line_grouping=LineGrouping.CHAN_PER_LINE,
            )

    def start(self) -> None:
        """Starts the sample clock."""
        self._input.start()
        if self._deadlines is not None:
            self._deadlines.each_s = self._settings.stale_after_s + _GRPC_MARGIN_S
            self._deadlines.until = math.inf

    def read(self) -> Array:
        """The next block of volts (channels, samples), valid until the next call."""
        asked = self.samples
        try:
            got = self._reader.read_many_sample(
                self._buffer,
                number_of_samples_per_channel=asked,
                timeout=self._settings.stale_after_s,
            )
        except AssertionError:  # how nidaqmx notices a reply that is longer than its array
            raise NonsenseReply(f"more than {asked} samples per channel came") from None
        if got != asked:
            raise NonsenseReply(f"{got} samples per channel came instead of {asked}")
        peak = np.abs(self._buffer).max()
        if not peak < IMPLAUSIBLE_V:  # also true for nan
            raise NonsenseReply(f"a sample of {peak:.4g} V came from a -10..10 V input")
        return self._buffer

    def drive_line(self, high: bool) -> None:
        """Sets the Reset/Operate line."""
        self._line.write(high, auto_start=True, timeout=self._settings.stale_after_s)

    def identity(self) -> Mapping[str, str]:
        """Product type, serial number (hexadecimal, as on NI's label) and driver version."""
        options = self._options()
        device = Device(self._settings.device, grpc_options=options)
        system = System.local() if options is None else System.remote(options)
        version = system.driver_version
        serial = device.serial_num
        return {
            "daq_product_type": device.product_type,
            "daq_serial_number": f"{serial:08X}" if serial else "none",
            "daq_driver_version": ".".join(str(part) for part in version),
        }

    def close(self) -> None:
        """Ends tasks and connection within about a second; also from another thread, also twice."""
        with self._close_once:
            tasks = [task for task in (self._input, self._line) if task is not None]
            self._input = self._line = None
            if self._deadlines is not None:
                self._deadlines.until = time.monotonic() + _CLOSE_S
            for task in tasks:
                with contextlib.suppress(*DAQ_ERRORS):
                    task.close()
            if self._channel is not None:
                self._channel.close()  # calls still under way fail at once
            self._channel = None

    def _connect(self, address: str, until: float) -> None:
        probe(address, until)
        self._deadlines = Deadlines(math.inf, until)
        channel = grpc.insecure_channel(
            address,
            options=[
                ("grpc.enable_http_proxy", 0),  # a DAQ is in this room, not behind a web proxy
                ("grpc.enable_retries", 0),
                ("grpc.use_local_subchannel_pool", 1),  # a new open() starts without old back-off
                ("grpc.max_receive_message_length", -1),
            ],
        )
        self._channel = grpc.intercept_channel(channel, self._deadlines)

    def _create_input(self) -> None:
        settings = self._settings
        self._input = self._task()
        first = int(settings.first_channel.removeprefix("ai"))
        self._input.ai_channels.add_ai_voltage_chan(
            f"{settings.device}/ai{first}:{first + settings.channels - 1}",
            terminal_config=_TERMINALS[settings.terminal],
            min_val=-10.0,
            max_val=10.0,
        )
        rate = settings.sample_rate_Hz
        self._input.timing.cfg_samp_clk_timing(
            rate,
            sample_mode=AcquisitionType.CONTINUOUS,
            samps_per_chan=round(rate * BUFFER_S * max(1.0, self._speed)),
        )
        self._reader = AnalogMultiChannelReader(self._input.in_stream)
        self._reader.verify_array_shape = False  # checking costs a call to the server a read

    def _task(self) -> Any:
        return nidaqmx.Task(grpc_options=self._options())

    def _options(self) -> Any:
        if self._channel is None:
            return None
        return nidaqmx.GrpcSessionOptions(self._channel, "")


def probe(address: str, until: float) -> None:
    """Raises CannotConnect with the network's reason; gRPC alone would just say "unavailable"."""
    host, _, port = address.rpartition(":")
    remedy = "Start the server there and check `grpc_server` in the station file."
    try:
        network.connect(host.strip("[]"), int(port), until).close()
    except ConnectionRefusedError:
        fault = f"nothing listens at {address}: no gRPC device server runs there"
        raise CannotConnect(DEVICE, fault, remedy) from None
    except TimeoutError:
        fault = f"{address} does not answer: the gRPC device server's computer is not reachable"
        raise CannotConnect(DEVICE, fault, remedy) from None
    except OSError as error:
        fault = f"{address} cannot be reached ({error.strerror or error})"
        raise CannotConnect(DEVICE, fault, remedy) from None
