"""`rig list`: what it shows, what it leaves out with which reason, and its catalogue."""

from __future__ import annotations

import json
import os
import re
import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from rig import cli
from rig.catalogue import cache_folder, recall, remember
from rig.dataset import write
from rig.errors import InputError
from rig.journal import Journal, journal_path
from rig.listing import list_folder
from rig.storage.seal import seal_of
from rig.storage.summary import _of_meta, as_written, by_any_program, read_summary
from rig.tables import import_table
from tests.unit.example_data import META_SPECIMEN, dataset, write_journal
from tests.unit.report_sets import sketched

GOLDEN = Path(__file__).parents[1] / "golden" / "list_text.txt"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Each test knows nothing at first."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("RIG_CACHE", str(folder))
    return folder


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    """A measured set, an imported specimen below, an incomplete run, and three that are none."""
    return Path(shutil.copytree(written, tmp_path / "data"))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What each test has a copy of."""
    where = tmp_path_factory.mktemp("written")
    here = where / "data"
    (here / "old").mkdir(parents=True)
    (here / ".hidden").mkdir()
    write(dataset(), here / "arm.h5")
    write(dataset(), here / ".hidden/arm.h5")
    write(specimen(where), here / "old/specimen.h5")
    write_journal(here / "cut.h5", 3)
    (here / "broken.h5").write_bytes((here / "arm.h5").read_bytes()[:9000])
    (here / "notes.h5").write_text("no HDF5 at all")
    with h5py.File(here / "other.hdf5", "w") as file:
        file["x"] = np.arange(3)
    (here / "readme.txt").write_text("not looked at")
    return here


def specimen(where: Path):  # type: ignore[no-untyped-def]
    force = np.linspace(0, 100, 40)
    rows = "".join(f"{i},{f:.3f},{f / 95:.5f}\n" for i, f in enumerate(force))
    (where / "t.csv").write_text(f"time_s,force_N,displacement_mm\n{rows}")
    (where / "m.yaml").write_text(META_SPECIMEN)
    found = import_table(where / "t.csv", where / "m.yaml")
    return replace(found, created="2026-04-01T12:30:00+02:00")


def test_text_word_for_word(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a deliberate change: write the text to the golden file, and read it."""
    monkeypatch.chdir(folder.parent)
    listing = list_folder(Path("data"), analyze=True)
    digest = seal_of(folder / "old/specimen.h5")
    remember("verdict", {digest: {"word": "joint_yield", "probability": 0.934}})
    # how large a whole file is depends on the HDF5 library
    text = re.sub(r"left of \d+", "left of N", list_folder(Path("data")).to_text())
    assert text + "\n" == GOLDEN.read_text()
    assert len(listing.entries) == 3


def test_a_narrow_terminal_gets_two_lines_a_file(folder: Path) -> None:
    listing = list_folder(folder)
    wide = max(map(len, listing.to_text().splitlines()[1:5]))
    assert replace(listing, width=wide).to_text() == listing.to_text()
    narrow = replace(listing, width=wide - 1).to_text().splitlines()
    assert narrow[1:5] == [
        "file             date              robot  samples",
        "  state; directions; k N/mm; verdict",
        "arm.h5           2026-03-01 10:00  ur10e        5",
        "  complete, EMULATED; x y; -; -",
    ]
    assert len(narrow) == len(listing.to_text().splitlines()) + 4


def test_json_has_units_and_null_for_what_nobody_knows(folder: Path) -> None:
    found = list_folder(folder).to_json()
    assert found["schema"] == "rig.list/1"
    by_file = {d["file"]: d for d in found["datasets"]}
    assert list(by_file) == ["arm.h5", "cut.h5", os.path.join("old", "specimen.h5")]
    arm = by_file["arm.h5"]
    assert (arm["robot"], arm["directions"], arm["origin"]) == ("ur10e", ["x", "y"], "emulated")
    assert (arm["complete"], arm["samples"], arm["journal"]) == (True, 5, False)
    assert arm["stiffness_N_per_mm"] is None
    assert arm["verdict"] is None
    assert by_file["cut.h5"]["journal"] is True
    assert by_file["cut.h5"]["complete"] is False
    assert by_file["cut.h5"]["samples"] == 3
    assert {s["file"] for s in found["skipped"]} == {"broken.h5", "notes.h5", "other.hdf5"}


def test_what_commands_found_is_shown_and_only_for_these_bytes(folder: Path) -> None:
    path = folder / "old/specimen.h5"
    done = CliRunner().invoke(cli.app, ["analyze", str(path), "--json", "-"])
    k = json.loads(done.output)["directions"]["x"]["stiffness_N_per_mm"]
    entry = list_folder(folder).entries[-1]
    assert entry.stiffness is not None
    assert entry.stiffness["x"]["value"] == k["value"]
    assert entry.stiffness["x"]["ci95"] == k["ci95"]
    copy = folder / "copy.h5"
    copy.write_bytes(path.read_bytes())
    assert next(e for e in list_folder(folder).entries if e.file == "copy.h5").stiffness is not None
    other = replace(specimen(folder.parent), uuid="22222222-2222-3333-4444-555555555555")
    write(other, copy)
    assert next(e for e in list_folder(folder).entries if e.file == "copy.h5").stiffness is None


def test_an_analysis_with_other_choices_is_not_remembered(folder: Path) -> None:
    path = str(folder / "old/specimen.h5")
    for choice in (["--weighting", "none"], ["--through-origin"]):
        CliRunner().invoke(cli.app, ["analyze", path, *choice])
    CliRunner().invoke(cli.app, ["diagnose", path, "--withhold", "joint_yield"])
    entry = list_folder(folder).entries[-1]
    assert (entry.stiffness, entry.verdict) == (None, None)
    CliRunner().invoke(cli.app, ["diagnose", path])
    verdict = list_folder(folder).entries[-1].verdict
    assert verdict is not None
    assert verdict["word"] == "none"


def test_what_a_report_found_is_remembered(folder: Path) -> None:
    path, page = str(folder / "old/specimen.h5"), str(folder / "page.html")
    with sketched():
        CliRunner().invoke(cli.app, ["report", path, "-o", page, "--no-gap"])
        entry = list_folder(folder).entries[-1]
        assert entry.stiffness is not None
        assert entry.verdict is None  # nobody asked
        CliRunner().invoke(cli.app, ["report", path, "-o", page])
    verdict = list_folder(folder).entries[-1].verdict
    assert verdict is not None
    assert verdict["word"] == "none"


def test_an_open_run_is_never_taken_from_the_catalogue(folder: Path) -> None:
    path = folder / "arm.h5"
    list_folder(folder, analyze=True)
    write_journal(path, 2)
    entry = next(e for e in list_folder(folder).entries if e.file == "arm.h5")
    assert (entry.open, entry.stiffness, entry.summary.rows) == (True, None, 2)
    assert "INCOMPLETE, EMULATED" in list_folder(folder).to_text()


def test_what_a_journal_tells_is_not_remembered_of_the_older_file(folder: Path) -> None:
    path = folder / "arm.h5"
    write_journal(path, 2)
    entry = next(e for e in list_folder(folder, analyze=True).entries if e.file == "arm.h5")
    assert entry.stiffness is not None
    journal_path(path).unlink()
    assert next(e for e in list_folder(folder).entries if e.file == "arm.h5").stiffness is None


@pytest.mark.parametrize("damage", ["catalogue.sqlite", "folder", "nothing kept", "old software"])
def test_a_useless_catalogue_stops_nothing(
    damage: str, folder: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = list_folder(folder, analyze=True)
    if damage == "catalogue.sqlite":
        (cache / damage).write_bytes(b"rubbish" * 999)
    elif damage == "folder":
        monkeypatch.setenv("RIG_CACHE", str(folder / "arm.h5"))
    elif damage == "nothing kept":
        monkeypatch.setenv("RIG_CACHE", "")
        assert cache_folder() is None
    else:
        with sqlite3.connect(cache / "catalogue.sqlite") as db:
            db.execute("UPDATE found SET software = 'stiffness-rig 0.0.1'")
    after = list_folder(folder)
    assert [e.summary for e in after.entries] == [e.summary for e in before.entries]
    assert all(e.stiffness is None for e in after.entries)


def test_a_second_listing_opens_no_known_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = list_folder(folder)
    opened: list[Path] = []
    monkeypatch.setattr("rig.listing.read_summary", lambda p: opened.append(p) or read_summary(p))
    assert list_folder(folder) == first
    assert {p.name for p in opened} == {"other.hdf5"}


def test_a_changed_file_is_looked_at_again(folder: Path) -> None:
    path = folder / "arm.h5"
    list_folder(folder, analyze=True)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    # the last line is what it was: only who reads the values can tell
    path.write_bytes(bytes(content[:-40]))
    found = list_folder(folder)
    assert "arm.h5" in dict(found.skipped)


def test_a_damaged_copy_of_a_known_file_is_left_out(folder: Path) -> None:
    list_folder(folder, analyze=True)
    content = bytearray((folder / "arm.h5").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (folder / "copy.h5").write_bytes(content)
    assert seal_of(folder / "copy.h5") == seal_of(folder / "arm.h5")  # its last line tells nothing
    found = list_folder(folder)
    assert "copy.h5" not in {e.file for e in found.entries}
    assert dict(found.skipped)["copy.h5"] == (
        "damaged: its bytes have changed since it was written. "
        "Restore it from a copy. Without one: lay copy.h5.journal beside it, if the measurement "
        "was cut short, and `rig` reads that instead; import a table again with `rig import`."
    )


def test_no_resuming_is_offered_of_a_run_that_is_still_measured(folder: Path) -> None:
    with Journal.reopen(journal_path(folder / "cut.h5")):
        found = list_folder(folder)
        text = found.to_text()
    (entry,) = (d for d in found.to_json()["datasets"] if d["file"] == "cut.h5")
    assert (entry["running"], entry["complete"], entry["journal"]) == (True, False, True)
    assert "RUNNING, EMULATED" in text
    assert "Being measured now: cut.h5." in text
    assert "--resume" not in text
    assert "cut.h5; `rig measure --resume FILE` goes on there." in list_folder(folder).to_text()


def test_what_is_said_to_fill_in_k_fills_it_in(folder: Path) -> None:
    assert "k -: not analysed yet; `rig list --analyze` does it." in list_folder(folder).to_text()
    journal_path(folder / "cut.h5").unlink()
    text = list_folder(folder).to_text()
    assert "k -: not analysed yet; `rig list --analyze` or `rig analyze FILE` does it." in text
    assert "k -" not in list_folder(folder, analyze=True).to_text()


def test_a_damaged_journal_is_left_out(folder: Path) -> None:
    journal = journal_path(folder / "cut.h5")
    lines = journal.read_bytes().splitlines(keepends=True)
    lines[2] = lines[2].replace(b"sample", b"simple")
    journal.write_bytes(b"".join(lines))
    found = list_folder(folder)
    assert "cut.h5" not in {e.file for e in found.entries}
    assert "cut.h5.journal:3: damaged: its checksum" in dict(found.skipped)["cut.h5"]


def test_recall_asks_for_any_number_of_files() -> None:
    remember("summary", {f"{i:064d}": i for i in range(1203)})
    assert len(recall([f"{i:064d}" for i in range(1203)])) == 1203
    assert recall([]) == {}


def test_no_folder_and_a_file_for_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none: no such folder; a folder with data sets"):
        list_folder(tmp_path / "none")
    (tmp_path / "a.h5").write_text("")
    with pytest.raises(InputError, match="a file; a folder with data sets is wanted"):
        list_folder(tmp_path / "a.h5")
    (tmp_path / "empty").mkdir()
    assert "no data sets (.h5, .hdf5)" in list_folder(tmp_path / "empty").to_text()


@pytest.mark.parametrize(
    "text",
    [
        META_SPECIMEN,
        META_SPECIMEN.replace("{x: [1, 0, 0]}", "{x: [1, 0, 0]}  # along"),
        META_SPECIMEN.replace("directions: {x: [1, 0, 0]}", "directions:\n  x: [1, 0, 0]"),
        META_SPECIMEN.replace("{x: [1, 0, 0]}", '{"x": [1, 0, 0]}'),
        META_SPECIMEN.replace("robot: none", 'robot: "none"'),
        '{"robot": "none", "directions": {"x": [1, 0, 0]}}',
    ],
    ids=["as people write", "comment", "block", "quoted", "quoted robot", "JSON"],
)
def test_robot_and_directions_of_any_way_to_write_them(text: str) -> None:
    assert _of_meta(text, "META") == ("none", ("x",))


def test_what_another_program_stored_anew_is_read_as_well(folder: Path) -> None:
    path = folder / "arm.h5"
    before = read_summary(path)
    assert as_written(path) == by_any_program(path)
    assert seal_of(path)  # neither has touched the file
    with h5py.File(path, "r+") as file:  # fixed lengths and small numbers, as other libraries do
        for name in ("uuid", "title"):
            text = str(file.attrs[name]).encode()
            file.attrs.create(name, text, dtype=h5py.string_dtype("utf-8", len(text)))
        file.attrs.create("rows", file.attrs["rows"], dtype="u2")
    with pytest.raises(OSError, match="no appropriate function for conversion"):
        as_written(path)
    assert read_summary(path) == before


def test_seal_is_none_where_the_end_is_not_whole(folder: Path) -> None:
    whole = (folder / "arm.h5").read_bytes()
    assert len(seal_of(folder / "arm.h5")) == 64
    middle = whole[:5000] + whole[5001:]
    for content in (b"", middle, whole[:-1], whole + b"\n", whole[:40], b"x" + whole[1:]):
        (folder / "part.h5").write_bytes(content)
        assert seal_of(folder / "part.h5") == ""


def test_a_journal_without_a_start_is_left_out(folder: Path) -> None:
    for content in (b"", b"{}\n", b"\xff\xfe", b"[1]\n"):
        journal_path(folder / "cut.h5").write_bytes(content)
        assert "no start of a measurement" in dict(list_folder(folder).skipped)["cut.h5"]
