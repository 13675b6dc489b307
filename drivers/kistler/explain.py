"""What NI-DAQmx and gRPC say, in words an operator can act on."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import BadReply, CannotConnect, DeviceError, ReadTimeout
from drivers.kistler.settings import KistlerSettings

DEVICE = "dynamometer"


class NonsenseReply(Exception):
    """The reply has the right form and an impossible content; the text says which."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """What an error means. `kind` is its class in mid-run; while connecting it is CannotConnect."""

    kind: type[DeviceError]
    fault: str
    remedy: str


_BY_NI_CODE = {
    -201003: Trouble(
        ReadTimeout,
        'the DAQ device "{device}" is not accessible: unplugged or without power',
        "Check its cable and power, {again}.",
    ),
    -200324: Trouble(
        ReadTimeout,
        'the DAQ device "{device}" is absent or was taken by another computer',
        "Check its cable, power and network reservation, {again}.",
    ),
    -200220: Trouble(
        ReadTimeout,
        'there is no DAQ device named "{device}"',
        "Correct `device` in the station file; NI MAX or `nilsdev` (Linux) lists the names.",
    ),
    -200170: Trouble(
        BadReply,
        'the DAQ device "{device}" lacks a channel or line of the station file'
        ' ({channels} channels from "{first_channel}", reset_line {reset_line})',
        "Correct `first_channel`, `channels` or `reset_line` in the station file.",
    ),
    -200077: Trouble(
        BadReply,
        'the DAQ device "{device}" refuses a setting; the likeliest is terminal "{terminal}"',
        "Correct `terminal` in the station file to what the device's manual offers.",
    ),
    -200081: Trouble(
        BadReply,
        'the DAQ device "{device}" cannot sample {channels} channels at {sample_rate_Hz:g} Hz',
        "Lower `sample_rate_Hz` in the station file.",
    ),
    -200279: Trouble(
        BadReply,
        "samples were overwritten before they were read: this computer fell behind",
        "Close other programs or lower `sample_rate_Hz` in the station file, {again}.",
    ),
    -200361: Trouble(
        BadReply,
        "the FIFO of the DAQ device overflowed: its bus could not keep up",
        "Give the device a USB port of its own or lower `sample_rate_Hz`, {again}.",
    ),
    -200284: Trouble(
        ReadTimeout,
        "no samples came within {stale_after_s:g} s: the sample clock of the DAQ device stands",
        'Reset "{device}" in NI MAX or replug it, {again}.',
    ),
    -50405: Trouble(
        ReadTimeout,
        "the data transfer was aborted, as when the DAQ device was pulled out",
        "Replug the device, wait until the computer knows it again, {again}.",
    ),
    -50103: Trouble(
        BadReply,
        'another program holds the DAQ device "{device}"',
        "Close that program (NI MAX test panels too), {again}.",
    ),
}
_BY_GRPC_STATUS = {
    "UNAVAILABLE": Trouble(
        ReadTimeout,
        "the connection to the gRPC device server at {grpc_server} was lost",
        "Check the server's computer and the network, {again}.",
    ),
    "NO_SERVER": Trouble(
        CannotConnect,
        "at {grpc_server} no gRPC device server answers: the port closes connections or speaks"
        " another protocol",
        "Start NI's gRPC device server there, or correct `grpc_server` in the station file.",
    ),
    "DEADLINE_EXCEEDED": Trouble(
        ReadTimeout,
        "the gRPC device server at {grpc_server} does not answer within {limit_s:g} s",
        "Restart the server on the DAQ's computer, {again}.",
    ),
    "UNIMPLEMENTED": Trouble(
        BadReply,
        "the gRPC server at {grpc_server} does not know a call of NI-DAQmx",
        "Install NI's gRPC device server there, version 2 or later, or correct `grpc_server`.",
    ),
    "INTERNAL": Trouble(
        BadReply,
        "the gRPC device server at {grpc_server} answered with bytes that make no sense",
        "Check that `grpc_server` names NI's gRPC device server and that the versions match.",
    ),
}
NO_DRIVER = Trouble(
    CannotConnect,
    "the NI-DAQmx driver is not installed on this computer",
    "Install NI-DAQmx from ni.com, or set `grpc_server` to a computer that has it.",
)


def device_error(error: Exception, settings: KistlerSettings, *, connecting: bool) -> DeviceError:
    """The `DeviceError` for one of `drivers.kistler.daq.DAQ_ERRORS`.

    While connecting everything is a CannotConnect but replies without sense; the text is the same.
    """
    trouble = _trouble(error, connecting)
    kind = trouble.kind
    if connecting and not _is_nonsense(error):
        kind = CannotConnect
    words = vars(settings) | {
        "limit_s": settings.connect_deadline_s if connecting else settings.stale_after_s,
        "again": "then start again" if connecting else "then go on with --resume",
    }
    raised = kind(DEVICE, trouble.fault.format(**words), trouble.remedy.format(**words))
    raised.__cause__ = error
    return raised


def _trouble(error: Exception, connecting: bool) -> Trouble:
    from nidaqmx.errors import DaqError, DaqNotFoundError, DaqNotSupportedError

    if isinstance(error, DaqNotFoundError | DaqNotSupportedError):
        return NO_DRIVER
    if isinstance(error, DaqError):
        return _BY_NI_CODE.get(error.error_code) or Trouble(
            BadReply,
            f"NI-DAQmx reports error {error.error_code}: {_first_sentence(error)}",
            "Look the number up in NI's documentation or try the device in NI MAX.",
        )
    if isinstance(error, NonsenseReply | ValueError):
        return Trouble(
            BadReply,
            f"the DAQ device gave a reply without sense: {_first_sentence(error)}",
            "Check that device and server are what the station file says, and restart them.",
        )
    status = _grpc_status(error)
    if status in {"UNAVAILABLE", "CANCELLED"}:  # a server that shuts down cancels its calls
        status = "NO_SERVER" if connecting else "UNAVAILABLE"
    return _BY_GRPC_STATUS.get(status) or Trouble(
        BadReply,
        f"the gRPC device server at {{grpc_server}} failed with {status or type(error).__name__}",
        "Read the server's own log, and restart it.",
    )


def _grpc_status(error: Exception) -> str:
    """Name of the gRPC status of nidaqmx' RpcError or grpc's own; empty when it has none."""
    code = getattr(error, "rpc_code", None)
    if code is None and callable(getattr(error, "code", None)):
        code = error.code()  # type: ignore[attr-defined]
    return str(getattr(code, "name", ""))


def _is_nonsense(error: Exception) -> bool:
    nonsense = isinstance(error, NonsenseReply | ValueError)
    return nonsense or _grpc_status(error) in {"INTERNAL", "UNIMPLEMENTED"}


def _first_sentence(error: Exception) -> str:
    """First line of NI's text, braces doubled because it passes through `str.format`."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    text = lines[0] if lines else type(error).__name__
    return text.rstrip(".").replace("{", "{{").replace("}", "}}")
