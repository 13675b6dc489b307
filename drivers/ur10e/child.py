"""The process in which the real client library lives, so that it can be killed.

Started by `process.ReceiveProcess` with its settings (JSON) as the only argument; sends one JSON
object a line on what was its standard output. It ends when its standard input closes, that is
when its parent is gone for whatever reason.
"""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any, BinaryIO

from drivers.ur10e.reduce import Reduction
from drivers.ur10e.rtde import VARIABLES

# The constructor of the library holds the interpreter's lock and may never return; this watchdog
# of faulthandler is a thread in C that needs no lock and then ends the process.
WATCHDOG_S = 10.0
_STATUS_EVERY_S = 0.1


def main() -> None:
    """Receives until the parent goes, the library fails, or the watchdog bites."""
    options = json.loads(sys.argv[1])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer,
    if sys.platform != "win32":
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # and so is a terminal that is closed
    out = _private_output()
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    faulthandler.dump_traceback_later(options["connect_s"] + 1.0, exit=True)
    try:
        receive = _connect(options["host"], options["frequency_Hz"])
        _poll(receive, out, options["block_s"], options["poll_s"])
    except BrokenPipeError:
        os._exit(0)
    except (ImportError, RuntimeError) as error:
        _send(out, {"error": str(error)})
        os._exit(3)


def _private_output() -> BinaryIO:
    """Standard output for our messages alone: the library's chatter goes to standard error."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return out


def _exit_with_parent() -> None:
    while os.read(0, 1):
        pass
    os._exit(0)


def _send(out: BinaryIO, message: dict[str, Any]) -> None:
    out.write(json.dumps(message).encode() + b"\n")
    out.flush()


def _connect(host: str, frequency_Hz: float) -> Any:
    from rtde_receive import RTDEReceiveInterface

    return RTDEReceiveInterface(host, frequency_Hz, list(VARIABLES), False)


def _poll(receive: Any, out: BinaryIO, block_s: float, poll_s: float) -> None:
    """One value for each timestamp of the controller; a block every `block_s` wall seconds.

    The library returns its last values for ever once the controller is gone: only a timestamp
    that has moved on is a new value, and what it shows at the start counts as old.
    """
    reduction = Reduction()
    seen = receive.getTimestamp()
    status_due = fed = 0.0
    while True:
        now = time.monotonic()
        if now - fed > 1.0:
            faulthandler.dump_traceback_later(WATCHDOG_S, exit=True)
            fed = now
        if (timestamp := receive.getTimestamp()) != seen:
            row = _row(receive, timestamp)
            if row is not None:
                seen = timestamp
                reduction.add(now, row)
        if reduction.span_s(now) >= block_s:
            _send(out, reduction.take())
            status_due = now + _STATUS_EVERY_S
        elif now >= status_due:
            status = {"timestamp": seen, "connected": receive.isConnected()}
            _send(out, {"status": status})
            status_due = now + _STATUS_EVERY_S
        time.sleep(poll_s)


def _row(receive: Any, timestamp: float) -> tuple[float, ...] | None:
    """All variables in the order of VARIABLES; None if a package just arriving tore them."""
    values: list[float | Sequence[float]] = [
        timestamp,
        receive.getActualQ(),
        receive.getTargetQ(),
        receive.getActualQd(),
        receive.getActualTCPPose(),
        receive.getActualCurrent(),
        receive.getTargetCurrent(),
        receive.getJointTemperatures(),
        receive.getRobotMode(),
        receive.getSafetyMode(),
        receive.getSafetyStatusBits(),
        receive.getRuntimeState(),
    ]
    if receive.getTimestamp() != timestamp:
        return None
    row: list[float] = []
    for value in values:
        row.extend(value if isinstance(value, Sequence) else (value,))
    return tuple(row)


if __name__ == "__main__":
    main()
