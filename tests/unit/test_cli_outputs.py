"""The command line: what is written where, and what it may take the place of."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.unit.cli_bench import Rig


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("analyze no.h5 --json no/such/r.json",
         "--json no/such/r.json: the folder no/such does not exist. Create it"),
        ("analyze no.h5 --json .",
         "--json .: is a folder. Give the name of a file, or - for stdout."),
        ("analyze no.h5 --json shut/r.json",
         "--json shut/r.json: nothing may be written into the folder shut."),
        ("diagnose no.h5 --figures m.yaml", "--figures m.yaml: m.yaml is a file, no folder."),
        ("diagnose no.h5 --figures m.yaml/f", "--figures m.yaml/f: m.yaml is a file, no folder."),
        ("diagnose no.h5 --figures shut/f", "--figures shut/f: nothing may be written into the"),
        ("diagnose no.h5 --write-model no/m.yaml", "--write-model no/m.yaml: the folder no does"),
        ("report no.h5 --pdf no/r.pdf", "--pdf no/r.pdf: the folder no does not exist."),
        ("export no.h5 -o .", "--output .: is a folder. Give the name of a file."),
        ("export no.h5 -o -", "--output -: this one goes to a file only. Give its name."),
    ],
)  # fmt: skip
def test_places_that_could_not_be_written_to_are_said_before_the_work(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch, words: str, says: str
) -> None:
    (files / "shut").mkdir()
    monkeypatch.setattr(os, "access", lambda folder, _mode: folder != "shut")
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err.startswith(says)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("analyze d.h5 --json d.h5", "--json d.h5: is read by this command"),
        ("diagnose d.h5 --write-model ./d.h5", "--write-model d.h5: is read by this command"),
        ("analyze d.h5 --json other.h5", "--json other.h5: is a data set;"),
        ("list . --json d.h5", "--json d.h5: is a data set;"),
        ("export d.h5 -o d.h5", "--output d.h5: is read by this command"),
        ("import t.csv m.yaml -o m.yaml", "--output m.yaml: is read by this command"),
        ("check p.yaml --json p.yaml", "--json p.yaml: is read by this command"),
        ("simulate model.yaml p.yaml --csv p.yaml", "--csv p.yaml: is read by this command"),
    ],
)
def test_no_result_takes_the_place_of_an_input_or_a_measurement(
    rig: Rig, files: Path, words: str, says: str
) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    assert rig("import", "t.csv", "m.yaml", "-o", "other.h5")[0] == 0
    before = {p.name: p.read_bytes() for p in files.iterdir()}
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err.startswith(says)
    assert "Give another name." in err
    assert {p.name: p.read_bytes() for p in files.iterdir()} == before


def test_a_result_may_replace_an_older_result(rig: Rig, files: Path) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    (files / "r.json").write_text("{}")
    assert rig("analyze", "d.h5", "--json", "r.json")[0] == 0
    assert json.loads((files / "r.json").read_text())["schema"] == "rig.analysis/1"
    status, _, err = rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    assert status == 0
    assert "d.h5: replaced; an earlier import stood there" in err.splitlines()
    assert "replaced" not in rig("import", "t.csv", "m.yaml", "-o", "new.h5")[2]


def test_json_that_cannot_be_written_costs_no_result(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    (files / "r.json").write_text("older")

    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    status, out, err = rig("analyze", "d.h5", "--json", "r.json")
    assert status == 2
    assert "N/mm" in out
    assert err.startswith("r.json: cannot be written: No space left on device.")
    assert (files / "r.json").read_text() == "older"
    (files / "link.json").symlink_to("r.json")
    status, _, err = rig("analyze", "d.h5", "--json", "link.json")
    assert (status, err) == (2, "link.json: cannot be written: No space left on device.\n")


def test_json_goes_into_a_pipe_and_through_a_link(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    (files / "link.json").symlink_to("real.json")
    (files / "real.json").write_text("older")
    os.mkfifo("pipe.json")
    pipe = os.open("pipe.json", os.O_RDONLY | os.O_NONBLOCK)
    for place in ("pipe.json", "link.json"):
        assert rig("analyze", "d.h5", "--json", place)[0] == 0
    assert os.read(pipe, 60_000).startswith(b'{\n  "schema": "rig.analysis/1"')
    os.close(pipe)
    assert (files / "link.json").is_symlink()
    assert json.loads((files / "real.json").read_text())["schema"] == "rig.analysis/1"
