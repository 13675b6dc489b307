"""Sets everything up in `.venv` and runs the demonstration or the tests; needs Python only.

    python3 bootstrap.py demo     the paper's procedure on the emulated station, then its analysis
    python3 bootstrap.py test     style, types, import rules and tests, as CI runs them
    python3 bootstrap.py setup    nothing further

Further words after `test` go to pytest: `python3 bootstrap.py test -m slow`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from subprocess import DEVNULL, PIPE, STDOUT

HOME = Path(__file__).resolve().parent
VENV = HOME / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")
SUPPORTED = ((3, 11), (3, 12))  # ur-rtde has wheels for no newer ones
STAMP = VENV / "installed-for.txt"
DEMO = HOME / "out" / "demo"
WORKERS = min((os.cpu_count() or 2) + 1, 8)  # processes that test
QUIET = ("--quiet", "--disable-pip-version-check")
# Style, import rules and types, which take the longest.
CHECKS = (["ruff", "check", "."], ["ruff", "format", "--check", "."], ["lint-imports"], ["mypy"])


def main() -> int:
    """Runs what the command line asks for; returns its exit status."""
    words = sys.argv[1:]
    if not words or words[0] not in ("demo", "test", "setup"):
        print(__doc__, file=sys.stderr)
        return 2
    if sys.version_info[:2] not in SUPPORTED:
        return _with_supported_python()
    _install("" if words[0] == "demo" else "[dev]")
    if words[0] == "setup":
        return 0
    return _demo() if words[0] == "demo" else _test(words[1:])


def _with_supported_python() -> int:
    for major, minor in reversed(SUPPORTED):
        found = shutil.which(f"python{major}.{minor}")
        # A launcher may stand in the path for a version that it doesn't have.
        if (
            found
            and subprocess.run([found, "-c", ""], capture_output=True, check=False).returncode == 0
        ):
            return subprocess.call([found, *sys.argv])
    here = ".".join(map(str, sys.version_info[:3]))
    print(
        f"This is Python {here}; stiffness-rig needs 3.11 or 3.12, because the robot's client "
        "library has wheels for these. Install one of them, then run this command with it.",
        file=sys.stderr,
    )
    return 2


def _install(extras: str) -> None:
    wanted = "\n".join(
        [extras, (HOME / "pyproject.toml").read_text(), (HOME / "constraints.txt").read_text()]
    )
    done = STAMP.read_text() if STAMP.exists() else ""
    if done == wanted or (done.startswith("[dev]") and done[len("[dev]") :] == wanted):
        return
    print("Setting up .venv (some minutes the first time)", file=sys.stderr, flush=True)
    if not STAMP.exists():  # also where an earlier attempt was interrupted
        subprocess.check_call([sys.executable, "-m", "venv", str(VENV)])
    # What is imported compiles itself, and most of what is installed never is.
    install = [str(PYTHON), "-m", "pip", "install", "--no-compile", *QUIET]
    subprocess.check_call([*install, "-c", "constraints.txt", "-e", f".{extras}"], cwd=HOME)
    STAMP.write_text(wanted)


def _call(command: list[str]) -> int:
    """Ctrl-C reaches the command too, which ends in its own way: it is waited for."""
    with subprocess.Popen(command, cwd=HOME) as child:
        while True:
            try:
                return child.wait()
            except KeyboardInterrupt:
                continue


def _demo() -> int:
    shutil.rmtree(DEMO, ignore_errors=True)
    DEMO.mkdir(parents=True)
    data, figures = str(DEMO / "paper_xy.h5"), str(DEMO / "figures")
    rig = str(BIN / "rig")
    measure = [rig, "measure", "protocols/paper_xy.yaml", "--station", "emulated", "-o", data]
    analyze = [rig, "analyze", data, "--figures", figures]
    return _call(measure) or _call(analyze)


def _test(words: list[str]) -> int:
    # whoever is done takes work from the others; one more than there are processors, because some
    # tests wait long for devices
    tests = ["pytest", "-n", str(WORKERS), "--dist", "worksteal", *words]
    # Compiled modules are kept, or every process that tests compiles all of them anew.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    checks = [(check, _started(check)) for check in CHECKS]
    subprocess.call(_path(["pytest", "--collect-only", *words]), cwd=HOME, stdout=DEVNULL)
    *quick, types = checks  # which take long enough to go on beside the tests
    failed = [_status(*check) for check in quick]
    if any(failed):
        types[1].kill()
        types[1].wait()
        return next(status for status in failed if status)
    tested = _call(_told(tests))
    return _status(*types) or tested


def _started(check: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(_path(check), cwd=HOME, text=True, stdout=PIPE, stderr=STDOUT)


def _status(check: list[str], running: subprocess.Popen[str]) -> int:
    """Exit status of a check, whose words are then told."""
    said, _ = running.communicate()
    _told(check)
    print(said, end="", flush=True)
    return running.returncode


def _told(command: list[str]) -> list[str]:
    print("+", " ".join(command), flush=True)
    return _path(command)


def _path(command: list[str]) -> list[str]:
    return [str(BIN / command[0]), *command[1:]]


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
