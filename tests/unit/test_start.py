"""Ctrl-C before a command has begun, while modules are still imported."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rig import start

HOME = Path(__file__).parents[2]
# Python's handler first: whoever runs the tests in the background may have it ignored.
INTERRUPTED = """
import os, runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
sys.argv = ["rig", "couple", "data/models/F1.yaml"]
runpy.run_module("rig", run_name="__main__")
"""


@pytest.mark.parametrize(
    "module", ["rig.cli", "rig.cli.commands", "rig.intruders", "drivers.errors", "rig.coupling"]
)
def test_an_interrupt_during_imports_ends_with_130_and_no_traceback(module: str) -> None:
    code = INTERRUPTED.format(module=module)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=HOME, capture_output=True, text=True, check=False
    )
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert "bug" not in done.stderr


def test_a_command_hears_interrupts_again() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        start.leave_when_interrupted()
        assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
        start.hear_interrupts()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # as `nohup` and shells' background have it
        start.leave_when_interrupted()
        start.hear_interrupts()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
