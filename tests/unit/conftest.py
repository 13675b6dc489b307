"""The command line in this process, for the tests that are named after it."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from rig import cli
from tests.unit.cli_bench import ARM_META, HOME, META, TABLE, Rig
from tests.unit.runner_bench import PROTOCOL


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Rig:
    """Runs `rig WORDS` in this process, in a folder of its own: status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rig", *words])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
        out, err = capsys.readouterr()
        code = ending.value.code
        return (code if isinstance(code, int) else 0), out, err

    return run


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "m.yaml").write_text(META)
    (tmp_path / "t.csv").write_text(TABLE)
    (tmp_path / "p.yaml").write_text(PROTOCOL)
    return tmp_path


@pytest.fixture
def arm(rig: Rig, files: Path) -> Path:
    """With `a.h5`, an arm's session, and a model."""
    (files / "arm.yaml").write_text(ARM_META)
    shutil.copy(HOME / "data" / "models" / "F1.yaml", files)
    # It gives way at the last level, or something drifts: there is something to tell apart.
    (files / "k.csv").write_text(TABLE.replace(",100,1.", ",100,1.5"))
    assert rig("import", "k.csv", "arm.yaml", "-o", "a.h5")[0] == 0
    return files
