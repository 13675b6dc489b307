"""Processes beside this one: what they are told, what they say, and that they end."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rig.child_process import ChildProcess, Ending

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sessions and signals of POSIX")
Start = Callable[[str], ChildProcess]
PATIENCE_S = 30.0  # of a busy machine


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Starts a module with this text, which lies where PYTHONPATH looks."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    started: list[ChildProcess] = []

    def start(text: str) -> ChildProcess:
        (tmp_path / "some_module.py").write_text(text)
        started.append(ChildProcess("some_module"))
        return started[-1]

    yield start
    for child in started:
        child.kill()
        child.close()


def test_it_hears_answers_and_ends_when_its_input_closes(start: Start) -> None:
    child = start(
        "import sys, rig.errors\nfor line in sys.stdin: print(line.upper(), end='', flush=True)"
    )
    child.send(b"one\n")
    assert child.output.readline() == b"ONE\n"
    child.close_input()
    assert child.ended_within(PATIENCE_S)
    assert child.ending() == Ending(0, "")
    child.close_input()  # nothing happens


def test_its_last_words_tell_how_it_ended(start: Start) -> None:
    child = start("import sys\nsys.stderr.write('first\\n\\nlast \\xb0 word\\n\\n')\nsys.exit(7)")
    assert child.ended_within(PATIENCE_S)
    assert child.ending() == Ending(7, "last ° word")
    with pytest.raises(BrokenPipeError):
        child.send(b"x" * 100_000)
    child.close()
    assert child.ending() == Ending(7, "")


def test_ctrl_c_is_for_who_started_it(start: Start) -> None:
    child = start("import sys\nprint(flush=True)\nsys.stdin.read()")
    child.output.readline()
    assert os.getsid(child.pid) == child.pid != os.getsid(0)


def test_a_deaf_one_is_ended_by_force(start: Start) -> None:
    child = start("import time\nprint(flush=True)\nwhile True: time.sleep(1)")
    child.output.readline()
    child.close_input()
    assert not child.ended_within(0.05)
    assert child.ending() == Ending(None, "")
    child.kill()
    assert child.ending() == Ending(-9, "")
    child.kill()
    child.close()
    with pytest.raises(ValueError, match="closed file"):
        child.send(b"x")
