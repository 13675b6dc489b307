"""The command line: statuses, one message for wrong input, nothing heavy at start."""

from __future__ import annotations

import errno
import os
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

from identification.estimate import WEIGHTINGS
from rig.software import software_version
from tests.unit.cli_bench import HOME, Rig, unread


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["measure"], "give a PROTOCOL.yaml, or --resume DATASET.h5"),
        (["measure", "p.yaml", "--resume", "d.h5"], "give a PROTOCOL.yaml, or --resume"),
        (["measure", "none.yaml"], "none.yaml"),
        (["measure", "p.yaml", "--station", "emulate"], 'Did you mean "emulated"?'),
        (["measure", "p.yaml", "--station", "emulated", "-o", "no/such/run.h5"], "does not exist"),
        (["measure", "--resume", "never.h5"], "nothing to resume. Nor is that file there"),
        (["measure", "--resume", "t.csv"], "nothing to resume. A complete measurement"),
        (["check", "m.yaml"], "m.yaml"),
        (["analyze", "t.csv"], "t.csv"),
        (["analyze", "missing.h5"], "missing.h5"),
        (["analyze", "."], "."),
        (["import", "t.csv", "t.csv", "-o", "x.h5"], "t.csv"),
        (["import", "m.yaml", "m.yaml", "-o", "x.h5"], "m.yaml"),
        (["import", "t.csv", "m.yaml", "-o", "no/such/x.h5"], "no/such"),
        (["export", "missing.h5", "-o", "x.csv"], "missing.h5"),
        (["emulate", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_bad_input_is_status_2_and_one_message(
    rig: Rig, files: Path, words: list[str], says: str
) -> None:
    status, out, err = rig(*words)
    assert status == 2
    assert says in err
    assert out == ""
    assert "Traceback" not in err
    assert not list(files.glob("*.journal"))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("measure --resume d.h5 --station nope", "--station nope: a measurement that is resumed"),
        ("measure --resume d.h5 -o e.h5", "-o e.h5: a measurement that is resumed"),
        (
            "diagnose d.h5 --add joint_yield --withhold joint_yield",
            "--add joint_yield, --withhold joint_yield: exclude each other.",
        ),
        (
            "diagnose d.h5 --add joint_yeld",
            '--add: "joint_yeld" is no effect. Did you mean "joint_yield"?',
        ),
        (
            "diagnose d.h5 --withhold time_lag --withhold zeroshift",
            '--withhold: "zeroshift" is no effect. Did you mean "zero_shift"?',
        ),
        ("diagnose d.h5 --add xyz", '--add: "xyz" is no effect. Known: base_compliance, base_slip'),
    ],
)
def test_options_that_contradict_each_other_are_refused(
    rig: Rig, files: Path, words: str, says: str
) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    status, _, err = rig(*words.split())
    assert status == 2
    assert err.startswith(says)


def test_the_list_of_commands_cuts_no_sentence(rig: Rig) -> None:
    status, out, _ = rig("--help")
    assert status == 0
    assert "..." not in out.partition("Commands:")[2]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("words", [[], ["--json", "-"]])
def test_a_full_disk_behind_standard_output_is_no_bug(
    rig: Rig, files: Path, words: list[str]
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "rig", "analyze", "d.h5", *words],
            cwd=files,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        )
    said = f"standard output: cannot be written: {os.strerror(errno.ENOSPC)}.\n"
    assert (ended.returncode, ended.stderr) == (2, said)


@pytest.mark.parametrize("words", [["frobnicate"], ["measure", "--stations", "x"], ["analyze"]])
def test_wrong_words_are_status_2(rig: Rig, words: list[str]) -> None:
    status, _, err = rig(*words)
    assert status == 2
    assert "Traceback" not in err


def test_a_mistyped_command_is_told_the_one_that_was_meant(rig: Rig) -> None:
    status, _, err = rig("diagnos", "d.h5")
    assert status == 2
    assert 'rig diagnos: no such command. Did you mean "diagnose"?' in err


def _damaged(raw: bytes, rng: random.Random) -> bytes:
    kind = rng.randrange(4)
    if kind == 0:
        return raw[: rng.randrange(len(raw))]
    if kind == 1:
        at = rng.randrange(len(raw))
        return raw[:at] + rng.randbytes(rng.randint(1, 40)) + raw[at:]
    if kind == 2:
        lines = raw.splitlines(keepends=True)
        del lines[rng.randrange(len(lines))]
        return b"".join(lines)
    flipped = bytearray(raw)
    for _ in range(rng.randint(1, 20)):
        flipped[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


@pytest.mark.parametrize("seed", range(60))
def test_damaged_files_end_with_0_or_2_and_never_a_traceback(
    rig: Rig, files: Path, seed: int
) -> None:
    rng = random.Random(seed)
    if seed % 3 == 2:
        rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    name, words = {
        0: ("t.csv", ["import", "t.csv", "m.yaml", "-o", "x.h5"]),
        1: ("m.yaml", ["import", "t.csv", "m.yaml", "-o", "x.h5"]),
        2: ("d.h5", ["analyze", "d.h5"]),
    }[seed % 3]
    path = files / name
    path.write_bytes(_damaged(path.read_bytes(), rng))
    status, _, err = rig(*words)
    assert status in (0, 2)
    assert "Traceback" not in err
    if status == 2:
        assert name in err
    elif name == "d.h5":
        pytest.fail("a damaged HDF5 file was read as if it were whole")


def test_a_bug_is_status_1_and_a_file_for_the_report(tmp_path: Path) -> None:
    code = (
        "import rig.check, sys\n"
        "def boom(*_): raise RuntimeError('unforeseen')\n"
        "rig.check.check = boom\n"
        "sys.argv = ['rig', 'check', 'p.yaml']\n"
        "from rig.cli import main; main()\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(HOME), "TMPDIR": str(tmp_path)},
    )
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    assert "This is a bug in rig (RuntimeError: unforeseen)" in result.stderr
    reports = list(tmp_path.glob("rig-bug-*.txt"))
    assert len(reports) == 1
    assert "unforeseen" in reports[0].read_text()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("code", "status"),
    [
        # After everything: modules are taken down.
        (
            "import os, sys\n"
            "class Late:\n"
            "    def __del__(self, kill=os.kill, me=os.getpid()): kill(me, 2)\n"
            "late = Late(); sys.argv = ['rig', '--version']\n"
            "from rig.cli import main; main()\n",
            0,
        ),
        # Before any command runs.
        (
            "import os, rig.intruders\n"
            "rig.intruders.refuse_intruders = lambda: os.kill(os.getpid(), 2)\n"
            "from rig.cli import main; main()\n",
            130,
        ),
        # While the last word is said.
        (
            "import os, sys, rig.cli.endings as endings\n"
            "endings.say = lambda _: os.kill(os.getpid(), 2)\n"
            "sys.argv = ['rig', 'check', 'never.yaml']; endings.main()\n",
            130,
        ),
    ],
)
def test_ctrl_c_at_an_odd_moment_kills_nothing(code: str, status: int) -> None:
    # a shell has what it runs in the background ignore SIGINT, tests and all that these start
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    result = subprocess.run(
        [sys.executable, "-c", heard + code], cwd=HOME, capture_output=True, text=True, check=False
    )
    assert (result.returncode, "Traceback" in result.stderr) == (status, False), result.stderr


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; sys.argv = ['rig', '--help']\n"
        "from rig.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'pandas', 'h5py', 'scipy', 'matplotlib', 'pydantic', 'nidaqmx'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=HOME, capture_output=True, text=True, check=True
    )
    assert "HEAVY []" in result.stdout
    for command in ("measure", "check", "analyze", "import", "export", "emulate"):
        assert command in result.stdout


@pytest.mark.parametrize("wanted", [None, "2"])
def test_linear_algebra_has_one_thread_unless_the_user_says_otherwise(wanted: str | None) -> None:
    code = (
        "import os, sys; sys.argv = ['rig', '--help']\n"
        "from rig.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print('THREADS', os.environ['OPENBLAS_NUM_THREADS'])\n"
    )
    env = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    env |= {} if wanted is None else {"OPENBLAS_NUM_THREADS": wanted}
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=HOME, capture_output=True, text=True, check=True, env=env
    )
    assert f"THREADS {wanted or 1}" in result.stdout


def test_packages_of_other_distributions_are_noticed(tmp_path: Path) -> None:
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "__init__.py").write_text("")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.path.insert(1, {str(HOME)!r})\n"
    code += "sys.argv = ['rig', 'check', 'x']\nfrom rig.cli import main; main()\n"
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 2, result.stderr
    assert "the package drivers comes from" in result.stderr


def test_version(rig: Rig) -> None:
    status, out, err = rig("--version")
    assert (status, err) == (0, "")
    assert out == f"{software_version()}\n"
    assert re.fullmatch(r"stiffness-rig \d+\.\d+\.\d+\n", out)
    assert "How stiff is this arm, and why" in rig("--help")[1]


def test_the_help_names_every_weighting(rig: Rig) -> None:
    said = " ".join(rig("analyze", "--help")[1].split()).replace("- ", "-")  # wrapped lines
    for word in WEIGHTINGS:
        assert word in said.split("how the points are weighted")[0]


@pytest.mark.parametrize(
    ("words", "both", "ends"),
    [
        ("--help", False, 141),
        ("analyze d.h5", False, 141),
        ("analyze d.h5 --json -", False, 141),
        ("list . --json -", True, 141),
        ("export d.h5 -o d.csv", True, 141),
        ("analyze --nope", True, 141),
        ("analyze none.h5", True, 2),
    ],
)
def test_a_reader_that_has_left_is_no_bug(
    rig: Rig, files: Path, words: str, both: bool, ends: int
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    assert unread(files, words, both=both) == (ends, "")
    assert not list(files.glob("rig-bug-*"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes have no names here")
@pytest.mark.parametrize(
    ("words", "name", "wanted"),
    [
        ("diagnose pipe.h5", "pipe.h5", "a data set"),
        ("list .", "pipe.h5", "a data set"),
        ("list .", "b.h5.journal", "a journal"),
        ("measure --resume b.h5", "b.h5.journal", "a journal"),
        ("import pipe.csv m.yaml -o d.h5", "pipe.csv", "a table"),
        (f"import {os.devnull} m.yaml -o d.h5", os.devnull, "a table"),
    ],
)
def test_nobody_waits_for_a_pipe(files: Path, words: str, name: str, wanted: str) -> None:
    if name != os.devnull:
        os.mkfifo(files / name)
    ended = subprocess.run(
        [sys.executable, "-m", "rig", *words.split()],
        cwd=files,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env={**os.environ, "PYTHONPATH": str(HOME)},
    )
    said = (
        f"is a pipe or a device, which can be read once only; {wanted} is read more often. "
        "Write it to a file, and give that.\n"
    )
    if words == "list .":
        assert ended.returncode == 0
        assert "Left out: " in ended.stdout
        assert ended.stdout.endswith(said)
    else:
        assert (ended.returncode, ended.stderr) == (2, f"{name}: {said}")
