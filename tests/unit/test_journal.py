"""The journal: what it acknowledged is there, whatever happened to process and file."""

from __future__ import annotations

import errno
import os
import random
import select
import signal
import stat
import subprocess
import sys
import threading
import time
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest

from rig.errors import InputError
from rig.journal import Journal, JournalError, is_being_written, journal_path, replay
from tests.unit.example_data import start

PROJECT = Path(__file__).parents[2]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    with Journal.create(tmp_path / "run.h5.journal", start()) as journal:
        for i in range(5):
            journal.append("event", {"kind": "note", "text": f"Nummer {i} °C", "value": i / 3})
    return tmp_path / "run.h5.journal"


def test_lies_beside_the_data_set() -> None:
    assert journal_path(Path("a/run.h5")) == Path("a/run.h5.journal")


def test_reads_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "j"
    data = {
        "text": 'Zeile\n"ä" \udc80',
        "number": 0.1 + 0.2,
        "list": [1, None, True],
        "in": {"a": 1},
    }
    with Journal.create(path, start()) as journal:
        assert journal.append("event", data) == 1
        assert journal.append("sample", {"np": np.float64(1.5), "array": np.arange(3)}) == 2
        assert journal.append("sample", {"nan": nan, "inf": [inf, -inf]}) == 3
    first, event, numbers, missing = replay(path)
    assert (first.number, first.kind, first.data["title"]) == (0, "start", "Steifigkeit längs x")
    assert event.data == data
    assert numbers.data == {"np": 1.5, "array": [0, 1, 2]}
    assert missing.data == {"nan": None, "inf": [None, None]}
    assert b"NaN" not in path.read_bytes()


def test_is_on_disk_before_append_returns(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[str, int]] = []
    real_write, real_sync = os.write, os.fsync

    def write(fd: int, data: bytes) -> int:
        calls.append(("write", fd))
        return real_write(fd, data[:7])  # the system may take less than it was given

    def sync(fd: int) -> None:
        calls.append(("fsync", fd))
        real_sync(fd)

    with Journal.reopen(path) as journal:
        monkeypatch.setattr(os, "write", write)
        monkeypatch.setattr(os, "fsync", sync)
        journal.append("event", {"kind": "note", "text": "long enough for several writes"})
        written = [name for name, _ in calls]
        assert written.count("write") > 3
        assert written[-1] == "fsync"
        assert len({fd for _, fd in calls}) == 1
    monkeypatch.undo()
    assert replay(path)[-1].data["text"] == "long enough for several writes"


@pytest.mark.parametrize("synced", [True, False])
def test_a_clock_that_runs_ahead_does_not_wait_for_the_disk(
    path: Path, synced: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[int] = []
    monkeypatch.setattr(os, "fsync", waits.append)
    with Journal.reopen(path, synced) as journal:
        journal.append("event", {"kind": "note", "text": "there"})
        assert bool(waits) is synced
        assert replay(path)[-1].data["text"] == "there"  # kill -9 would leave it there
    waits.clear()
    Journal.create(path.parent / "another", start(), synced).close()
    assert len(waits) == 1 + synced  # the folder in any case


def test_its_name_is_on_disk_when_it_is_created(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[bool] = []
    real_sync = os.fsync

    def sync(fd: int) -> None:
        synced.append(stat.S_ISDIR(os.fstat(fd).st_mode))
        real_sync(fd)

    monkeypatch.setattr(os, "fsync", sync)
    Journal.create(tmp_path / "j", start()).close()
    assert synced == [False, True]  # the start record, then the folder


def test_the_last_record_torn_anywhere_is_passed_over(path: Path) -> None:
    content = path.read_bytes()
    begin = content.rstrip(b"\n").rfind(b"\n") + 1
    for cut in range(begin, len(content) - 1):
        path.write_bytes(content[:cut])
        assert len(replay(path)) == 5, cut
        path.write_bytes(content[:cut] + b"\0" * 100)  # a loss of power may leave zeros
        assert len(replay(path)) == 5, cut


def test_goes_on_after_a_torn_record(path: Path) -> None:
    content = path.read_bytes()
    begin = content.rstrip(b"\n").rfind(b"\n") + 1
    for cut in range(begin - 1, len(content)):
        path.write_bytes(content[:cut])
        with Journal.reopen(path) as journal:
            found = len(journal.records)
            assert journal.append("event", {"kind": "note", "text": "resumed"}) == found
        records = replay(path)
        assert [r.number for r in records] == list(range(found + 1))
        assert records[-1].data["text"] == "resumed"
        assert path.read_bytes().endswith(b"}\n")  # nothing of the torn one is left
        assert found == (6 if cut == len(content) - 1 else 5)


def test_a_changed_byte_is_told_with_its_line(path: Path) -> None:
    content = path.read_bytes()
    ends = [i for i, byte in enumerate(content) if byte == ord("\n")]
    for line in (2, len(ends)):  # in the middle, and in the last finished one
        for at in range(ends[line - 2] + 1, ends[line - 1]):
            broken = bytearray(content)
            broken[at] ^= 4
            path.write_bytes(broken)
            with pytest.raises(InputError, match=rf"run.h5.journal:{line}: damaged"):
                replay(path)
    assert path.read_bytes() == broken
    with pytest.raises(InputError, match="damaged"):
        Journal.reopen(path)
    assert path.read_bytes() == broken  # nothing was cut off that is no torn tail


def test_a_lost_line_is_told(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:2] + lines[3:]))
    with pytest.raises(InputError, match=r":3: damaged: it has the number 3 \(record 2\)"):
        replay(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds no whole record"),
        (b"time_s,force_N\n1,2\n", ":1: damaged: its checksum does not fit"),
        (b"{}", "holds no whole record"),
    ],
)
def test_what_is_no_journal(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.journal"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        replay(path)


def test_missing_and_other_schema(path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        replay(path.with_name("none"))
    with pytest.raises(InputError, match="Without its journal"):
        Journal.reopen(path.with_name("none"))
    other = path.with_name("other")
    with Journal.create(other, start() | {"schema": "rig.journal/9"}):
        pass
    with pytest.raises(InputError, match=r"no start of rig.journal/1 but start of rig.journal/9"):
        replay(other)


def test_two_writers_are_refused(path: Path) -> None:
    with (
        Journal.reopen(path),
        pytest.raises(InputError, match="another measurement is writing"),
    ):
        Journal.reopen(path)
    Journal.reopen(path).close()


def test_whether_it_is_being_written_can_be_asked(path: Path) -> None:
    assert not is_being_written(path)
    assert not is_being_written(path.with_name("none"))
    with Journal.reopen(path):
        assert is_being_written(path)
    Journal.reopen(path).close()  # to ask has left no lock


def test_where_locks_cannot_be_asked_for_nothing_is_said_to_run(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.ENOLCK, "no locks on this drive")

    monkeypatch.setattr("rig.journal._take_lock", refused)
    assert not is_being_written(path)


def test_who_only_asks_keeps_no_measurement_from_its_journal(path: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    asking = os.open(path, os.O_RDONLY)
    fcntl.flock(asking, fcntl.LOCK_SH)
    threading.Timer(0.05, os.close, [asking]).start()
    Journal.reopen(path).close()


def test_an_older_journal_is_not_overwritten(path: Path) -> None:
    before = path.read_bytes()
    with pytest.raises(InputError, match="Go on with it"):
        Journal.create(path, start())
    assert path.read_bytes() == before
    with pytest.raises(InputError, match=r"cannot be created: .*\. Choose another folder"):
        Journal.create(path.parent / "none" / "j", start())


def test_a_full_disk_ends_at_the_last_whole_record(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real_write = os.write
    before = path.read_bytes()
    journal = Journal.reopen(path)

    def write(fd: int, data: bytes) -> int:
        if len(data) < 40:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real_write(fd, data[:10])

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(JournalError, match=r"record 6 could not be written: No space left.*resume"):
        journal.append("event", {"kind": "note", "text": "x"})
    monkeypatch.undo()
    assert path.read_bytes() == before
    with pytest.raises(JournalError, match="record 6"):  # no gap may come into being
        journal.append("event", {"kind": "note", "text": "y"})
    journal.close()
    journal.close()
    with Journal.reopen(path) as again:
        assert again.append("event", {"kind": "note", "text": "z"}) == 6


@pytest.mark.parametrize(("call", "kept"), [("write", 0), ("half", 0), ("fsync", 1)])
def test_an_interrupted_record_leaves_the_next_one_its_number(
    path: Path, monkeypatch: pytest.MonkeyPatch, call: str, kept: int
) -> None:
    """Ctrl-C or SIGTERM may strike anywhere in `append`; what comes then is still readable."""
    write = os.write

    def strike(fd: int, data: memoryview | None = None) -> int:
        monkeypatch.undo()
        if call == "half" and data is not None:
            write(fd, data[: len(data) // 2])
        raise KeyboardInterrupt

    before = len(replay(path))
    with Journal.reopen(path) as journal:
        monkeypatch.setattr(os, "fsync" if call == "fsync" else "write", strike)
        with pytest.raises(KeyboardInterrupt):
            journal.append("event", {"kind": "note", "text": "struck"})
        assert journal.append("event", {"kind": "note", "text": "next"}) == before + kept
        journal.append("stop", {"reason": "interrupted"})
    assert [r.number for r in replay(path)] == list(range(before + kept + 2))


def test_wrong_kinds_and_values_are_the_programs_fault(path: Path) -> None:
    with Journal.reopen(path) as journal:
        with pytest.raises(ValueError, match="record kind"):
            journal.append("smaple", {})
        with pytest.raises(TypeError, match="cannot hold object"):
            journal.append("event", {"thing": object()})
        assert journal.append("event", {"kind": "note", "text": "still good"}) == 6


WRITER = """
import sys
from pathlib import Path
from rig.journal import Journal
journal = Journal.reopen(Path(sys.argv[1]))
while True:
    number = journal.append("sample", {"values": {f"column{i}": i / 7 for i in range(40)}})
    print(number, flush=True)
"""


def test_kill_9_loses_nothing_acknowledged(tmp_path: Path) -> None:
    path = tmp_path / "run.h5.journal"
    Journal.create(path, start()).close()
    rng = random.Random(7)
    acknowledged = 0
    for _ in range(20):
        with subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)], cwd=PROJECT, stdout=subprocess.PIPE
        ) as writer:
            assert writer.stdout is not None
            assert select.select([writer.stdout], [], [], 60)[0], "the writer did not begin"
            time.sleep(rng.uniform(0, 0.03))
            os.kill(writer.pid, signal.SIGKILL)
            told = writer.stdout.read().splitlines(keepends=True)
        acknowledged = max([acknowledged, *(int(line) for line in told if line.endswith(b"\n"))])
        records = replay(path)
        assert [r.number for r in records] == list(range(len(records)))
        assert len(records) > acknowledged
    assert acknowledged > 20
