"""The calls of NI's gRPC device server that a voltage task and a digital output need."""
# ruff: noqa: ARG002 - the signatures are those of the generated servicer

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as messages
from nidaqmx._stubs import nidaqmx_pb2_grpc as stubs
from nidaqmx.constants import ChannelType, UsageTypeAI

from drivers.arrays import Array
from drivers.kistler.settings import KistlerSettings

_VERSION = {0x1272: 24, 0x1923: 8, 0x2F22: 0}  # NI-DAQmx major, minor, update
_PRODUCT_TYPE = 0x631
_CHANNEL_NAMES = 0x1273
_MEASUREMENT_TYPE = 0x695
_INPUTS = 32
_NI_BUFFER_S = 10.0
_GROUP_BY_CHANNEL = 0


class NiError(Exception):
    """An error code of NI-DAQmx, which goes to the client in the trailing metadata."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


class Hardware(Protocol):
    """What the tasks stand on."""

    def now(self) -> float:
        """Seconds of the sample clock."""

    def wait_until(self, when: float, timeout_s: float, alive: Callable[[], bool]) -> bool:
        """Waits for `when`; False after `timeout_s` wall seconds or when no longer `alive`."""

    def volts(self, t: Array, low: float, high: float) -> Array:
        """Volts (n, channels) at times (n,), digitised within low..high."""

    def drive_line(self, high: bool) -> None:
        """Sets the digital output."""


@dataclass
class Task:
    """One task of NI-DAQmx: an analog input or a digital output."""

    name: str
    channels: list[str] = field(default_factory=list)
    kind: ChannelType = ChannelType.ANALOG_INPUT
    low: float = -5.0
    high: float = 5.0
    terminal: int = -1
    rate: float = 1000.0
    buffer: int = 10_000
    started: float | None = None
    position: int = 0


class Tasks:
    """The tasks of one DAQ device; thread-safe."""

    def __init__(self, hardware: Hardware, settings: KistlerSettings) -> None:
        self.hardware = hardware
        self.settings = settings
        self._tasks: dict[str, Task] = {}
        self._count = 0
        self._lock = threading.Lock()

    def create(self) -> Task:
        """A new task with a name of its own."""
        with self._lock:
            task = Task(f"_unnamedTask<{self._count}>")
            self._count += 1
            self._tasks[task.name] = task
        return task

    def get(self, name: str) -> Task:
        """The task, or NI's error for one that was cleared."""
        with self._lock:
            if name not in self._tasks:
                raise NiError(-200088, "Task specified is invalid or does not exist.")
            return self._tasks[name]

    def all(self) -> list[Task]:
        """Tasks that were not cleared, in the order of creation."""
        with self._lock:
            return list(self._tasks.values())

    def clear(self, name: str) -> None:
        """Forgets the task; unknown names are no error at the end."""
        with self._lock:
            self._tasks.pop(name, None)

    def check_device(self, name: str) -> None:
        """Raises NI's error for a device that is not this one."""
        if name != self.settings.device:
            raise NiError(-200220, "Device identifier is invalid.")

    def inputs(self, physical: str) -> list[str]:
        """Channel names of "Dev1/ai0:7"."""
        device, _, range_ = physical.partition("/")
        self.check_device(device)
        match = re.fullmatch(r"ai(\d+)(?::(\d+))?", range_)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
        if match is None or not first <= last < _INPUTS:
            raise NiError(-200170, "Physical channel specified does not exist on this device.")
        return [f"{device}/ai{i}" for i in range(first, last + 1)]

    def read(self, task: Task, count: int, timeout_s: float, alive: Callable[[], bool]) -> Array:
        """The next `count` samples (count, channels), as soon as the sample clock has made them."""
        if task.started is None:
            raise NiError(-200983, "The task is not started.")
        until = task.started + (task.position + count) / task.rate
        if not self.hardware.wait_until(until, timeout_s, alive):
            raise NiError(-200284, "Some or all of the samples requested have not been acquired.")
        behind = (self.hardware.now() - task.started) * task.rate - task.position
        if behind > task.buffer:
            raise NiError(-200279, "The application is not able to keep up with the acquisition.")
        t = task.started + (task.position + np.arange(count)) / task.rate
        task.position += count
        return self.hardware.volts(t, task.low, task.high)[:, : len(task.channels)]


class TaskService(stubs.NiDAQmxServicer):  # type: ignore[misc]
    """Maps calls to tasks; what is not here answers "unimplemented", as an older server would."""

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks

    def GetSystemInfoAttributeUInt32(self, request: Any, context: Any) -> Any:
        """Driver version."""
        value = _VERSION.get(request.attribute_raw, 0)
        return messages.GetSystemInfoAttributeUInt32Response(value=value)

    def GetDeviceAttributeString(self, request: Any, context: Any) -> Any:
        """Product type."""
        self._tasks.check_device(request.device_name)
        known = {_PRODUCT_TYPE: "emulated NI DAQ"}
        value = known.get(request.attribute_raw, "")
        return messages.GetDeviceAttributeStringResponse(value=value)

    def GetDeviceAttributeUInt32(self, request: Any, context: Any) -> Any:
        """Serial number; 0 is NI's word for a device that has none."""
        self._tasks.check_device(request.device_name)
        return messages.GetDeviceAttributeUInt32Response(value=0)

    def CreateTask(self, request: Any, context: Any) -> Any:
        """A new task."""
        reply = messages.CreateTaskResponse(new_session_initialized=True)
        reply.task.name = self._tasks.create().name
        return reply

    def GetTaskAttributeString(self, request: Any, context: Any) -> Any:
        """Name of the task, or names of its channels."""
        task = self._tasks.get(request.task.name)
        names = request.attribute_raw == _CHANNEL_NAMES
        value = ", ".join(task.channels) if names else task.name
        return messages.GetTaskAttributeStringResponse(value=value)

    def CreateAIVoltageChan(self, request: Any, context: Any) -> Any:
        """Analog inputs with the range that was asked for."""
        task = self._tasks.get(request.task.name)
        task.channels = self._tasks.inputs(request.physical_channel)
        task.kind = ChannelType.ANALOG_INPUT
        task.low, task.high = request.min_val, request.max_val
        task.terminal = request.terminal_config_raw
        return messages.CreateAIVoltageChanResponse()

    def CfgSampClkTiming(self, request: Any, context: Any) -> Any:
        """Rate and buffer; NI makes the buffer no smaller than its own choice."""
        task = self._tasks.get(request.task.name)
        task.rate = request.rate
        task.buffer = max(request.samps_per_chan, round(_NI_BUFFER_S * request.rate))
        return messages.CfgSampClkTimingResponse()

    def StartTask(self, request: Any, context: Any) -> Any:
        """The first sample is taken now."""
        task = self._tasks.get(request.task.name)
        task.started, task.position = self._tasks.hardware.now(), 0
        return messages.StartTaskResponse()

    def StopTask(self, request: Any, context: Any) -> Any:
        """The sample clock stops."""
        self._tasks.get(request.task.name).started = None
        return messages.StopTaskResponse()

    def ClearTask(self, request: Any, context: Any) -> Any:
        """The task is gone."""
        self._tasks.clear(request.task.name)
        return messages.ClearTaskResponse()

    def GetReadAttributeString(self, request: Any, context: Any) -> Any:
        """Channels to read."""
        task = self._tasks.get(request.task.name)
        return messages.GetReadAttributeStringResponse(value=", ".join(task.channels))

    def GetChanAttributeInt32(self, request: Any, context: Any) -> Any:
        """Type of a channel; of an analogue one also that it measures a voltage."""
        task = self._tasks.get(request.task.name)
        value = task.kind.value
        if request.attribute_raw == _MEASUREMENT_TYPE:
            value = UsageTypeAI.VOLTAGE.value
        return messages.GetChanAttributeInt32Response(value_raw=value)

    def GetWriteAttributeUInt32(self, request: Any, context: Any) -> Any:
        """Lines in a digital channel."""
        return messages.GetWriteAttributeUInt32Response(value=1)

    def ReadAnalogF64(self, request: Any, context: Any) -> Any:
        """Samples, grouped by channel or by scan."""
        task = self._tasks.get(request.task.name)
        count = request.num_samps_per_chan
        volts = self._tasks.read(task, count, request.timeout, context.is_active)
        ordered = volts.T if request.fill_mode_raw == _GROUP_BY_CHANNEL else volts
        return messages.ReadAnalogF64Response(
            read_array=ordered.ravel().tolist(), samps_per_chan_read=count
        )

    def CreateDOChan(self, request: Any, context: Any) -> Any:
        """The Reset line, or NI's error for any other."""
        device, _, line = request.lines.partition("/")
        self._tasks.check_device(device)
        if line != self._tasks.settings.reset_line:
            raise NiError(-200170, "Physical channel specified does not exist on this device.")
        task = self._tasks.get(request.task.name)
        task.channels, task.kind = [request.lines], ChannelType.DIGITAL_OUTPUT
        return messages.CreateDOChanResponse()

    def WriteDigitalLines(self, request: Any, context: Any) -> Any:
        """Sets the Reset line."""
        self._tasks.get(request.task.name)
        self._tasks.hardware.drive_line(bool(request.write_array[-1]))
        return messages.WriteDigitalLinesResponse(samps_per_chan_written=1)
