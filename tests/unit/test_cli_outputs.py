"""The command line: what is written where, and what it may take the place of."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
import typer
from typer.core import TyperGroup

from rig.cli import app, drawn, guard, kinds
from tests.slow import slow_ones
from tests.unit.cli_bench import Rig
from tests.unit.report_sets import sketched


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            "analyze no.h5 --json no/such/r.json",
            "--json no/such/r.json: the folder no/such does not exist. Create it",
        ),
        (
            "analyze no.h5 --json .",
            "--json .: is a folder. Give the name of a file, or - for stdout.",
        ),
        (
            "analyze no.h5 --json shut/r.json",
            "--json shut/r.json: nothing may be written into the folder shut.",
        ),
        ("diagnose no.h5 --figures m.yaml", "--figures m.yaml: m.yaml is a file, no folder."),
        ("diagnose no.h5 --figures m.yaml/f", "--figures m.yaml/f: m.yaml is a file, no folder."),
        ("diagnose no.h5 --figures shut/f", "--figures shut/f: nothing may be written into the"),
        ("diagnose no.h5 --write-model no/m.yaml", "--write-model no/m.yaml: the folder no does"),
        ("report no.h5 --pdf no/r.pdf", "--pdf no/r.pdf: the folder no does not exist."),
        ("export no.h5 -o .", "--output .: is a folder. Give the name of a file."),
        ("export no.h5 -o -", "--output -: this one goes to a file only. Give its name."),
    ],
)
def test_places_that_could_not_be_written_to_are_said_before_the_work(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch, words: str, says: str
) -> None:
    (files / "shut").mkdir()
    monkeypatch.setattr(os, "access", lambda folder, _mode: folder != "shut")
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err.startswith(says)


@pytest.mark.parametrize(
    "words",
    [
        "analyze no.h5 --figures f --json f/curve.svg",
        "report no.h5 --figures . --json no_curve.csv",
        "diagnose no.h5 --figures . --json gap_points.csv",
    ],
)
def test_no_result_goes_where_a_figure_goes(rig: Rig, files: Path, words: str) -> None:
    (files / "f").mkdir()
    place = words.rsplit(maxsplit=1)[-1]
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err == f"--json {place}: a figure of --figures goes there. Give another name.\n"


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


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("diagnose no.h5 --json x --write-model ./x", "--write-model x, --json x: are one place"),
        ("identify no.h5 --write-protocol s --write-model s", "--write-model s, --write-protocol"),
        ("simulate no.yaml p.yaml --csv sub/../t --json t", "--csv sub/../t, --json t: are one"),
        ("report no.h5 -o r.html --json r.html", "--output r.html, --json r.html: are one place"),
        ("report no.h5 --json no_report.html", "--output no_report.html, --json no_report.html:"),
        ("report no.h5 --figures x --json x", "--json x, --figures x: are one place"),
        ("diagnose no.h5 --next m.yaml --json link", "--next m.yaml, --json link: are one place"),
    ],
)
def test_two_results_do_not_go_to_one_place(rig: Rig, files: Path, words: str, says: str) -> None:
    (files / "sub").mkdir()
    (files / "link").symlink_to("m.yaml")
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err.startswith(says)
    assert err.endswith("only one result can stand there. Give another name to one of them.\n")


@pytest.mark.parametrize(
    "words", ["diagnose no.h5 --write-model", "import t.csv m.yaml -o", "simulate m p --csv"]
)
def test_no_file_takes_the_place_of_a_device(rig: Rig, files: Path, words: str) -> None:
    os.mkfifo("pipe.h5")
    for place in (os.devnull, "pipe.h5"):
        status, out, err = rig(*words.split(), place)
        assert (status, out) == (2, "")
        option = "--output" if words.endswith("-o") else words.rsplit(maxsplit=1)[-1]
        assert err == (
            f"{option} {place}: is a pipe or a device, where only JSON may go. Give the name of a "
            "file.\n"
        )


def test_a_result_may_replace_an_older_result(rig: Rig, files: Path) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    assert rig("list", ".", "--json", "r.json")[0] == 0
    status, _, err = rig("analyze", "d.h5", "--json", "r.json")
    assert (status, err) == (0, "r.json: replaced; an earlier JSON written by rig stood there\n")
    assert json.loads((files / "r.json").read_text())["schema"] == "rig.analysis/1"
    status, _, err = rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    assert status == 0
    assert "d.h5: replaced; an earlier import stood there" in err.splitlines()
    assert "replaced" not in rig("import", "t.csv", "m.yaml", "-o", "new.h5")[2]


WRITTEN = [
    ("diagnose a.h5 --write-model", "f.yaml", "model written by rig"),
    ("diagnose a.h5 --next", "f.yaml", "protocol written by rig"),
    ("identify a.h5 --write-model", "f.yaml", "model written by rig"),
    ("identify a.h5 --write-protocol", "f.yaml", "protocol written by rig"),
    ("identify a.h5 --proposals 0 --export-mujoco", "f.xml", "arm exported by rig"),
    ("identify a.h5 --proposals 0 --export-urdf", "f.urdf", "arm exported by rig"),
    ("simulate F1.yaml p.yaml --csv", "f.csv", "table of curves"),
    ("report a.h5 --no-gap -o", "f.html", "page"),
    ("report a.h5 --no-gap --pdf", "f.pdf", "PDF"),
    ("export a.h5 -o", "f.csv", "table exported by rig"),
    ("export a.h5 -o", "f.parquet", "Parquet table"),
    ("check p.yaml --station emulated --json", "f.json", "JSON written by rig"),
    ("analyze a.h5 --json", "f.json", "JSON written by rig"),
    ("identify a.h5 --proposals 0 --json", "f.json", "JSON written by rig"),
    ("couple F1.yaml --samples 1000 --json", "f.json", "JSON written by rig"),
    ("diagnose a.h5 --json", "f.json", "JSON written by rig"),
    ("simulate F1.yaml p.yaml --json", "f.json", "JSON written by rig"),
    ("blind --cases 1 --json", "f.json", "JSON written by rig"),
    ("report a.h5 --no-gap --json", "f.json", "JSON written by rig"),
    ("list . --json", "f.json", "JSON written by rig"),
]
LONG = (
    "diagnose a.h5 --write-model",
    "diagnose a.h5 --next",
    "diagnose a.h5 --json",
    "blind --cases 1 --json",
    "check p.yaml --station emulated --json",
    "report a.h5 --no-gap --pdf",
    "report a.h5 --no-gap --json",
)


@pytest.mark.parametrize(
    ("words", "name", "kind"),
    slow_ones(WRITTEN, LONG),
)
def test_a_result_replaces_its_own_kind_only_and_says_so(
    rig: Rig, arm: Path, words: str, name: str, kind: str
) -> None:
    told = f"{name}: replaced; an earlier {kind} stood there"
    for earlier in (False, True):
        with sketched():  # where it is a report
            status, _, err = rig(*words.split(), name)
        assert status == 0, err
        assert (told in err.splitlines()) == earlier
    (arm / "mine").write_text('{"my": {"schema": "rig.analysis/1"}}')
    for other in ("F1.yaml", "p.yaml", "t.csv", "mine"):  # written by hand, or measured
        shutil.copy(arm / other, arm / name)
        status, out, err = rig(*words.split(), name)
        assert (status, out) == (2, "")
        option = "--output" if words.endswith("-o") else words.rsplit(maxsplit=1)[-1]
        assert err == (
            f"{option} {name}: exists and is no {kind}, so it is not replaced. "
            "Give another name, or move it away.\n"
        )
        assert (arm / name).read_bytes() == (arm / other).read_bytes()


def test_of_every_place_that_is_written_to_its_kind_is_known() -> None:
    """Without that a result of another command would be taken for an earlier one of its own."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    known = {*guard._READ, *guard._FOLDERS, *kinds._OF_OPTION, "output", "pdf"}  # two by ending
    for name, command in group.commands.items():
        assert command.callback is not None
        hints = get_type_hints(command.callback).items()
        paths = {option for option, hint in hints if Path in (hint, *get_args(hint))}
        options = {str(p.name) for p in command.params if p.param_type_name == "option"}
        assert options & paths <= known, f"rig {name}: see _OF_OPTION of kinds, _READ of guard"
        assert "figures" not in options or name in drawn._STEMS, f"rig {name}: see _STEMS of drawn"


DRAWN = [
    ("analyze a.h5", "pointwise"),
    ("couple F1.yaml --samples 1000", "map"),
    ("diagnose a.h5", "gap_points"),
    ("report a.h5 --no-gap --couple F1.yaml", "a_setup_P1"),
]


@pytest.mark.parametrize(
    ("words", "name"), slow_ones(DRAWN, tuple(words for words, _ in DRAWN[1:]))
)
def test_figures_replace_figures_of_rig_only(rig: Rig, arm: Path, words: str, name: str) -> None:
    command = [*words.split(), "--figures", "f"]
    own = arm / "f" / "curve.csv"  # which no command draws
    own.parent.mkdir()
    own.write_text("1,2\n")
    assert "replaced" not in rig(*command)[2]
    assert own.read_text() == "1,2\n"
    (arm / "f" / "mine.csv").write_text("1,2\n")
    written = [p for p in (arm / "f").iterdir() if p.stem != "mine" and p != own]
    status, _, err = rig(*command)
    assert (status, f"f: {len(written)} files replaced;" in err) == (0, True)
    assert any(p.stem == name for p in written)
    for path in written:
        what = "table written" if path.suffix == ".csv" else "figure drawn"
        kept = path.read_bytes()
        path.write_bytes(b"<svg/> 1,2,drawn by hand")
        status, out, err = rig(*command)
        assert (status, out) == (2, "")
        assert err == (
            f"--figures f/{path.name}: exists and is no {what} by rig, so it is not replaced. "
            "Give another folder, or move it away.\n"
        )
        path.write_bytes(kept)


@pytest.mark.slow
def test_a_report_under_its_own_name_says_what_it_replaced(rig: Rig, arm: Path) -> None:
    told = "a_report.html: replaced; an earlier page stood there"
    for earlier in (False, True):
        assert (told in rig("report", "a.h5", "--no-gap")[2].splitlines()) == earlier


def test_nothing_is_said_of_a_file_that_still_stands(rig: Rig, arm: Path) -> None:
    (arm / "m.json").touch()
    status, _, err = rig("simulate", "F1.yaml", "none.yaml", "--json", "m.json")
    assert status == 2
    assert "replaced" not in err


def test_json_that_cannot_be_written_costs_no_result(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    assert rig("list", ".", "--json", "r.json")[0] == 0
    before = (files / "r.json").read_text()

    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    status, out, err = rig("analyze", "d.h5", "--json", "r.json")
    assert status == 2
    assert "N/mm" in out
    assert err.startswith("r.json: cannot be written: No space left on device.")
    assert (files / "r.json").read_text() == before
    assert "replaced" not in err
    (files / "link.json").symlink_to("r.json")
    status, _, err = rig("analyze", "d.h5", "--json", "link.json")
    assert (status, err) == (2, "link.json: cannot be written: No space left on device.\n")


def test_json_goes_into_a_pipe_and_through_a_link(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    (files / "link.json").symlink_to("real.json")
    (files / "real.json").touch()
    os.mkfifo("pipe.json")
    pipe = os.open("pipe.json", os.O_RDONLY | os.O_NONBLOCK)
    for place in ("pipe.json", "link.json"):
        assert rig("analyze", "d.h5", "--json", place)[0] == 0
    assert os.read(pipe, 60_000).startswith(b'{\n  "schema": "rig.analysis/1"')
    os.close(pipe)
    assert (files / "link.json").is_symlink()
    assert json.loads((files / "real.json").read_text())["schema"] == "rig.analysis/1"
