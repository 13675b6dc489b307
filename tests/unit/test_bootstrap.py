"""The command that a newcomer types first, and leaves with Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import bootstrap

HOME = Path(__file__).parents[2]
COMMAND = """
import signal, sys, time
time.sleep(0.5)  # until whoever started this waits for it
try:
    print("ready", flush=True)
    for _ in range(600):  # a signal in the instant before a sleep doesn't cut that sleep short
        time.sleep(0.05)
except KeyboardInterrupt:
    time.sleep(1)  # as long as it takes to close a file
    print("kept", flush=True)
    sys.exit(4)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_lets_the_command_end_in_its_own_way() -> None:
    # a shell that starts the tests in the background has them ignore Ctrl-C; a terminal does not
    code = f"""import signal, sys, bootstrap
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(bootstrap._call([sys.executable, '-c', {COMMAND!r}]))"""
    started = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=HOME,
        text=True,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert started.stdout is not None
    assert started.stdout.readline() == "ready\n"
    os.killpg(started.pid, signal.SIGINT)
    said, complaints = started.communicate(timeout=30)
    assert (said, complaints, started.returncode) == ("kept\n", "", 4)


@pytest.mark.parametrize(("fails", "tested"), [("ruff", False), ("mypy", True), ("", True)])
def test_a_check_that_fails_is_told_and_ends_in_its_status(
    fails: str, tested: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def path(command: list[str]) -> list[str]:
        status = 3 if command[0] == fails else 0
        return [sys.executable, "-c", f"print('of', {command!r}); raise SystemExit({status})"]

    monkeypatch.setattr(bootstrap, "_path", path)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")  # as it is afterwards
    assert bootstrap._test(["-k", "x"]) == (3 if fails else 0)
    said = capfd.readouterr().out
    assert ("of ['pytest', '-n'" in said) == tested
    assert ("of ['mypy']" in said) == tested  # which goes on beside the tests
    assert "of ['ruff', 'check', '.']" in said
    assert "of ['lint-imports']" in said


def test_tests_that_fail_end_in_their_status(monkeypatch: pytest.MonkeyPatch) -> None:
    def path(command: list[str]) -> list[str]:
        return [sys.executable, "-c", f"raise SystemExit({2 if '-n' in command else 0})"]

    monkeypatch.setattr(bootstrap, "_path", path)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert bootstrap._test([]) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_check_that_is_killed_is_no_check_that_passed(monkeypatch: pytest.MonkeyPatch) -> None:
    def path(command: list[str]) -> list[str]:
        code = "import os; os.kill(os.getpid(), 9)" if command[0] == "ruff" else ""
        return [sys.executable, "-c", code]

    monkeypatch.setattr(bootstrap, "_path", path)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert bootstrap._test([]) != 0
