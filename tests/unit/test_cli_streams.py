"""The command line whose standard output or standard error can't be used."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.unit.cli_bench import HOME, unread

FULL = Path("/dev/full")
_NEEDS_FULL = pytest.mark.skipif(not FULL.exists(), reason="a device of Linux")


def _sh(folder: Path, words: str, **environment: str) -> tuple[int, str, str]:
    """Status, stdout and stderr of `rig WORDS` as a shell runs it, redirections and all."""
    ended = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m rig {words}"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(HOME), "TMPDIR": str(folder), **environment},
    )
    assert not list(folder.glob("rig-bug-*"))
    return ended.returncode, ended.stdout, ended.stderr


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (
            "identify a.h5 --proposals 1 --write-model n/m --write-protocol n/p --json n/j "
            "--export-urdf n/u",
            {"m", "p", "j", "u"},
        ),
        ("simulate F1.yaml p.yaml --csv n/c --json n/j", {"c", "j"}),
        pytest.param(
            "analyze a.h5 --figures n --json n/j",
            {"j", "curve.png", "curve.svg", "pointwise.png", "pointwise.svg"},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "report a.h5 --no-gap -o n/r.html --json n/j", {"r.html", "j"}, marks=pytest.mark.slow
        ),
        pytest.param(
            "diagnose a.h5 --write-model n/m --next n/p --json n/j",
            {"m", "p", "j"},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_reader_that_leaves_costs_no_file(
    arm: Path,
    words: str,
    wanted: set[str],
) -> None:
    (arm / "n").mkdir()
    status, err = unread(arm, words)
    assert status == 141
    assert {p.name for p in (arm / "n").iterdir()} == wanted
    for name in wanted - {"j"}:
        assert f"n/{name}: written" in err


@_NEEDS_FULL
def test_what_could_not_be_written_is_said_though_the_reader_has_left(arm: Path) -> None:
    status, err = unread(arm, f"simulate F1.yaml p.yaml --csv c.csv --json {FULL}")
    assert status == 2
    assert err == (f"c.csv: written\n{FULL}: cannot be written: {os.strerror(errno.ENOSPC)}.\n")


@_NEEDS_FULL
def test_a_full_disk_behind_standard_output_costs_no_file(arm: Path) -> None:
    status, _, err = _sh(arm, "simulate F1.yaml p.yaml --csv c.csv --json - >/dev/full")
    assert status == 2
    assert err == (
        f"c.csv: written\nstandard output: cannot be written: {os.strerror(errno.ENOSPC)}.\n"
    )
    assert (arm / "c.csv").exists()


@_NEEDS_FULL
def test_of_two_that_refuse_both_are_told(arm: Path) -> None:
    status, _, err = _sh(arm, "simulate F1.yaml p.yaml --csv c.csv --json /dev/full >/dev/full")
    assert status == 2
    assert err == f"c.csv: written\n{FULL}: cannot be written: {_NO_ROOM}.\n{_REFUSED}"


def test_what_the_encoding_of_standard_output_lacks_is_replaced(arm: Path) -> None:
    (arm / "\u65e5.h5").write_bytes((arm / "a.h5").read_bytes())
    status, out, _ = _sh(arm, "analyze \u65e5.h5", PYTHONIOENCODING="cp1252")
    assert (status, "?.h5" in out) == (0, True)


_NO_ROOM = os.strerror(errno.ENOSPC)
_REFUSED = f"standard output: cannot be written: {os.strerror(errno.ENOSPC)}.\n"


@_NEEDS_FULL
@pytest.mark.parametrize(
    ("words", "ends", "says"),
    [
        ("--version >/dev/full", 2, _REFUSED),
        ("--help >/dev/full", 2, _REFUSED),
        ("analyze --help >/dev/full", 2, _REFUSED),
        ("analyze nofile.h5 2>/dev/full", 2, ""),
        ("analyze 2>/dev/full", 2, ""),  # what the library says of wrong words
        ("2>/dev/full", 2, ""),
    ],
)
def test_a_stream_that_refuses_is_no_bug(tmp_path: Path, words: str, ends: int, says: str) -> None:
    assert _sh(tmp_path, words) == (ends, "", says)


@pytest.mark.parametrize(
    ("words", "ends", "out", "err"),
    [
        ("analyze a.h5 --json j >&-", 0, "", ""),
        ("analyze a.h5 --json - >&- 2>&- <&-", 0, "", ""),
        ("list . --json - 2>&-", 0, '"schema": "rig.list/1"', ""),
        ("export a.h5 -o e.csv 2>&-", 0, "", ""),
        ("--version >&-", 0, "", ""),
        ("analyze nofile.h5 >&-", 2, "", "nofile.h5: cannot be read: no such file."),
        ("analyze nofile.h5 2>&-", 2, "", ""),
        ("analyze 2>&-", 2, "", ""),
    ],
)
def test_a_stream_that_is_closed_leads_nowhere(
    arm: Path, words: str, ends: int, out: str, err: str
) -> None:
    status, printed, said = _sh(arm, words)
    assert status == ends
    assert out in printed
    assert err in said
    assert bool(out) == bool(printed)
    assert bool(err) == bool(said)
