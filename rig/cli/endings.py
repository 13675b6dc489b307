"""Every ending of the command and its exit status; no traceback for users."""

from __future__ import annotations

import atexit
import io
import os
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from types import TracebackType

import typer

from rig.cli.commands import app
from rig.cli.options import say
from rig.start import hear_interrupts

_UNREAD = 141  # as shells show the end of usual tools (128 + SIGPIPE): 1 would be a bug


def main() -> None:
    """Runs the command and turns every ending into its exit status; no traceback for users."""
    # Registered first, called last: while Python takes itself down Ctrl-C would kill the process,
    # with a status that is none of ours, when all has been done and said.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    try:
        _main()
    except KeyboardInterrupt:  # outside of what the library looks after
        sys.exit(130)


def _main() -> None:
    from rig.errors import InputError, MeasurementStopped
    from rig.intruders import refuse_intruders
    from rig.threads import one_each

    _open_streams()
    one_each()
    sys.excepthook = _report_bug
    try:
        refuse_intruders()
        _run()
    except InputError as error:
        _end(2, str(error))
    except MeasurementStopped as error:
        _end(4, f"Stopped: {error}")


def _open_streams() -> None:
    """A standard stream that is closed leads nowhere instead; or else the next file that is opened
    would have its number, and be written into by whoever believes it to be the stream. What its
    encoding lacks (a name in another script) is replaced."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            nowhere = Path(os.devnull).open(mode, encoding="utf-8", errors="replace")  # noqa: SIM115
            setattr(sys, name, nowhere)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def _run() -> None:
    # Only now: another distribution's `drivers` would fail here before it could be named.
    from drivers.errors import DeviceError, SafetyStop

    command = typer.main.get_command(app)
    hear_interrupts()
    try:
        # Ends the process itself: 0 done, 2 wrong arguments, 130 interrupted. Calling `app`
        # would put typer's hook, which prints tracebacks, in place of ours.
        command()
    except SystemExit as ending:
        if isinstance(ending.__context__, BrokenPipeError):  # typer's 1 for it
            _end_unread(_UNREAD)
        raise
    except BrokenPipeError:
        _end_unread(_UNREAD)
    except OSError as error:
        # Standard error refuses what the library has to say of wrong words.
        if not hasattr(error.__context__, "exit_code"):
            raise
        _end_unread(2)
    except SafetyStop as error:
        _end(4, f"Stopped for safety. {error}")
    except DeviceError as error:
        _end(3, str(error))


def _end(status: int, message: str) -> None:
    try:
        say(message)
    except BrokenPipeError:
        _end_unread(status)
    sys.exit(status)


def _end_unread(status: int) -> None:
    """Whoever read what is printed has left (`rig list | head -1`): nothing more is said."""
    sys.stdout = sys.stderr = io.StringIO()  # or Python would try again at its end
    sys.exit(status)


def _report_bug(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """What nobody foresaw: the traceback goes to a file, one message to the user."""
    with tempfile.NamedTemporaryFile(
        "w", prefix="rig-bug-", suffix=".txt", delete=False, encoding="utf-8"
    ) as file:
        traceback.print_exception(kind, error, trace, file=file)
    say(f"This is a bug in rig ({kind.__name__}: {error}). Please report it with {file.name}.")
