"""The other process: deadlines, crashes, restarts, and what it may know."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.blind.diagnosers import Diagnoser

STAND_IN = """
import json, os, sys, time
print(json.dumps({"ready": True}), flush=True)
for line in sys.stdin:
    path = json.loads(line)["path"]
    if path == "crash":
        raise RuntimeError("it broke")
    if path == "slow":
        time.sleep(10)
    if path == "refuse":
        print(json.dumps({"refused": "no simulation"}), flush=True)
        continue
    told = {"pid": os.getpid(), "threads": os.environ["OPENBLAS_NUM_THREADS"],
            "question": json.loads(line), "session": os.getsid(0) == os.getpid()}
    print(json.dumps({"diagnosis": told, "seconds": 0.25}), flush=True)
"""


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A module that answers in the worker's place."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    return "stand_in"


@pytest.fixture
def diagnoser(stand_in: str) -> Iterator[Diagnoser]:
    out = Diagnoser(20.0, stand_in)
    yield out
    out.close()


def test_the_question_is_path_and_withheld_words_alone(diagnoser: Diagnoser) -> None:
    reply = diagnoser.diagnose(Path("a.h5"), ("joint_yield",))
    assert reply.status == "answered"
    assert reply.seconds == 0.25
    assert reply.diagnosis is not None
    assert reply.diagnosis["question"] == {"path": "a.h5", "withhold": ["joint_yield"]}
    assert reply.diagnosis["threads"] == "1"
    assert reply.diagnosis["session"]  # Ctrl-C does not reach it


def test_one_process_serves_many_cases_until_it_crashes(diagnoser: Diagnoser) -> None:
    first, again = (diagnoser.diagnose(Path("a"), ()).diagnosis for _ in range(2))
    broken = diagnoser.diagnose(Path("crash"), ())
    assert (broken.status, broken.reason) == ("crashed", "RuntimeError: it broke")
    after = diagnoser.diagnose(Path("a"), ()).diagnosis
    assert first is not None
    assert again is not None
    assert after is not None
    assert first["pid"] == again["pid"] != after["pid"]


def test_refusals_keep_their_reason(diagnoser: Diagnoser) -> None:
    reply = diagnoser.diagnose(Path("refuse"), ())
    assert (reply.status, reply.reason) == ("refused", "no simulation")


def test_a_late_answer_is_given_up_and_the_process_with_it(stand_in: str) -> None:
    diagnoser = Diagnoser(0.5, stand_in)
    try:
        reply = diagnoser.diagnose(Path("slow"), ())
        assert (reply.status, reply.reason) == ("late", "not done after 0.5 s")
    finally:
        diagnoser.close()


def test_a_program_that_does_not_start_is_a_crash(stand_in: str, tmp_path: Path) -> None:
    (tmp_path / "stand_in.py").write_text("raise SystemExit('no such thing')")
    diagnoser = Diagnoser(5.0, stand_in)
    try:
        reply = diagnoser.diagnose(Path("a"), ())
        assert (reply.status, reply.reason) == ("crashed", "no such thing")
    finally:
        diagnoser.close()


def test_nothing_is_asked_after_the_end(diagnoser: Diagnoser) -> None:
    diagnoser.close()
    assert diagnoser.diagnose(Path("a"), ()).status == "crashed"


def test_a_case_under_way_when_the_check_stops_comes_back(diagnoser: Diagnoser) -> None:
    assert diagnoser.diagnose(Path("a"), ()).status == "answered"
    stop = threading.Timer(0.3, diagnoser.close)
    stop.start()
    reply = diagnoser.diagnose(Path("slow"), ())
    stop.join()
    assert reply.status == "crashed"
    assert reply.seconds < 5
