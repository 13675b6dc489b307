"""Where the program `rig` begins: quick to import, so that Ctrl-C is heard before the rest is."""

from __future__ import annotations

import os
import signal

_INTERRUPTED = 130


def main() -> None:
    """Imports the commands and runs one. Ctrl-C meanwhile ends the program without a traceback."""
    leave_when_interrupted()
    from rig.cli import main as run

    run()


def leave_when_interrupted() -> None:
    """Until `hear_interrupts`, Ctrl-C ends the process at once: nothing has begun, and an exception
    in the midst of an import would come out as a traceback, or as another error."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def hear_interrupts() -> None:
    """From now on Ctrl-C is KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _leave(*_: object) -> None:
    os._exit(_INTERRUPTED)
