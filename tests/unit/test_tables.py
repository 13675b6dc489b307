"""Tables: what comes in, what is refused and in which words, and that export gives it back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import example as one_example
from hypothesis import strategies as st

from rig.dataset import equal, load, write
from rig.errors import InputError
from rig.storage import csvblocks, csvcells
from rig.tables import import_table
from tests.unit import example_data as example
from tests.unit.example_data import TABLE, bring

# ------------------------------------------------------------------ what comes in


def test_every_column_of_the_format(tmp_path: Path) -> None:
    data = bring(tmp_path, TABLE)
    got = {name: values.tolist() for name, values in data.columns.items() if name != "q1_rad"}
    assert got == {
        "time_s": [0.5, 1.5, 2.5, 0.5],
        "session_s": [1.5, 2.5, 3.5, 60.5],
        "pose": ["P1"] * 4,
        "direction": ["x", "x", "x", "y"],
        "repetition": [1, 1, 1, 2],
        "branch": ["zero", "loading", "unloading", "cycle"],
        "step": [0, 1, 1, -1],
        "force_N": [0.02, 10.1, 9.9, -5e-7],
        "displacement_mm": [0, 0.1, 0.11, -1e-7],
        "discarded": [False] * 4,
    }
    np.testing.assert_array_equal(data.columns["q1_rad"], [0.1, 0.1001, np.nan, np.nan])
    assert (data.origin, data.complete, data.units["q1_rad"]) == ("imported", True, "rad")
    assert data.texts["meta"] == example.META


def test_an_imported_clock_has_no_date(tmp_path: Path) -> None:
    bring(tmp_path, TABLE, out=tmp_path / "o.h5")
    with h5py.File(tmp_path / "o.h5") as file:
        time = file["entry/samples/time"]
        assert (time.attrs["units"], time[:].tolist()) == ("s", [1.5, 2.5, 3.5, 60.5])


def test_what_is_left_out_gets_its_default(tmp_path: Path) -> None:
    meta = example.META.replace("{x: [1, 0, 0], y: [0, 1, 0]}", "{up: [0, 0, 1]}")
    data = bring(tmp_path, "displacement_mm,force_N\n0.5,1\n0.75,2\n", meta)
    got = {name: values.tolist() for name, values in data.columns.items()}
    assert got == {
        "time_s": [0, 1],
        "pose": ["P1", "P1"],
        "direction": ["up", "up"],
        "repetition": [1, 1],
        "branch": ["cycle", "cycle"],
        "step": [-1, -1],
        "force_N": [1, 2],
        "displacement_mm": [0.5, 0.75],
        "discarded": [False, False],
    }


def test_a_rig_without_an_arm(tmp_path: Path) -> None:
    data = bring(tmp_path, "force_N,displacement_mm\n1,2\n", example.META_SPECIMEN)
    assert data.meta.robot == "none"
    assert data.columns["pose"].tolist() == [""]
    assert data.meta.simulation is not None
    assert data.meta.simulation.stiffness_N_per_mm == {"x": 95.0}


def test_extreme_scales_and_a_force_of_zero(tmp_path: Path) -> None:
    rows = "".join(f"0,{d!r}\n" for d in (1e-7, 1.00000000001e-7, -3e-9, 1e4))
    data = bring(tmp_path, "force_N,displacement_mm\n" + rows, example.META_SPECIMEN)
    assert data.columns["displacement_mm"].tolist() == [1e-7, 1.00000000001e-7, -3e-9, 1e4]
    rows = "1e-6,0\n5e4,1\n-50000.00000001,2\n"
    data = bring(tmp_path, "force_N,displacement_mm\n" + rows, example.META_SPECIMEN)
    assert data.columns["force_N"].tolist() == [1e-6, 5e4, -50000.00000001]


@pytest.mark.parametrize(
    "change",
    [
        lambda t: "\ufeff" + t,
        lambda t: t.replace("\n", "\r\n"),
        lambda t: t.replace("\n", "\r"),
        lambda t: t.rstrip("\n"),
        lambda t: "# Prüfstand: °\n\n# a,b\n" + t.replace("\n2.5,", "\n\n#,,,,,,,,,\n  # x\n2.5,"),
        lambda t: t.replace(",", " , "),
        lambda t: t.replace(",", ",\t"),
        lambda t: t.replace("x", '"x"').replace("0.11", '"0.11"'),
        lambda t: t.replace("unloading,1", 'unloading,"1.0"'),
        lambda t: t.replace("9.9", "+9.90e0"),
    ],
)
def test_spellings_of_one_table(tmp_path: Path, change: Any) -> None:
    plain, other = bring(tmp_path, TABLE), bring(tmp_path, change(TABLE))
    assert plain.columns.keys() == other.columns.keys()
    for name, values in plain.columns.items():
        assert example.same_values(values, other.columns[name]), name


def test_further_columns_are_kept(tmp_path: Path) -> None:
    table = "note,force_N,displacement_mm,housing_C,mixed\n"
    rows = ['"slow, #1",1,2,0.5,01', ",1,3,,1", "Größe,1,4,inf,drei"]
    data = bring(tmp_path, table + "\n".join(rows), example.META_SPECIMEN)
    assert data.columns["note"].tolist() == ["slow, #1", "", "Größe"]
    np.testing.assert_array_equal(data.columns["housing_C"], [0.5, np.nan, np.inf])
    assert data.columns["mixed"].tolist() == ["01", "1", "drei"]
    assert data.units["housing_C"] == "degC"


def test_a_column_that_turns_to_text_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csvblocks, "BLOCK_BYTES", 64)
    rows = "".join(
        f"{i},{i / 7!r},{i if i != 90 else 'stop'},{'go' if i == 50 else ''}\n" for i in range(100)
    )
    data = bring(tmp_path, "force_N,displacement_mm,state,word\n" + rows, example.META_SPECIMEN)
    assert data.columns["word"].tolist() == ["go" if i == 50 else "" for i in range(100)]
    assert data.columns["force_N"].tolist() == list(range(100))
    assert data.columns["displacement_mm"].tolist() == [i / 7 for i in range(100)]
    assert data.columns["state"].tolist() == [str(i) if i != 90 else "stop" for i in range(100)]


def test_notes_on_what_looks_odd_but_is_allowed(tmp_path: Path) -> None:
    table = TABLE.replace("repetition", "repitition").replace("2.5,3.5", "0.1,0.2")
    notes = [e["text"] for e in bring(tmp_path, table).events if e["kind"] == "note"]
    assert notes == [
        'column "repitition" is kept and ignored; is "repetition" meant?',
        "time_s goes back 1 time, first at sample 3",
        "session_s goes back, first at sample 3",
        "q2_rad, q3_rad, q4_rad, q5_rad, q6_rad are missing: the joint readings that are there are "
        "not used",
    ]


@pytest.mark.parametrize("name", ["Branch", "Step", "Pose", "Session_s"])
def test_a_column_in_capitals_is_not_passed_over(tmp_path: Path, name: str) -> None:
    table = TABLE.replace(name.lower(), name, 1)
    notes = [e["text"] for e in bring(tmp_path, table).events if e["kind"] == "note"]
    assert notes[0] == f'column "{name}" is kept and ignored; is "{name.lower()}" meant?'


def test_a_missing_direction_may_stand_there_in_capitals(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'2: x, y\. Rename the column "Direction", or leave one'):
        bring(tmp_path, TABLE.replace("direction", "Direction", 1))


@pytest.mark.parametrize(
    ("steps", "kept", "note"),
    [
        (
            ["0", "1", "2", "1", "0", "-1", "-2", "", ""],
            [0, 1, 2, 1, 0, 3, 4, -1, -1],
            "steps below 0 are numbered on: -1 is 3 ... -2 is 4",
        ),
        (["0", "-1", "1"], [0, 2, 1], "steps below 0 are numbered on: -1 is 2"),
        (["-2", "-1"], [2, 1], "steps below 0 are numbered on: -1 is 1 ... -2 is 2"),
        (["0", "-1", "-1", ""], [0, -1, -1, -1], ""),
    ],
)
def test_steps_of_a_load_the_other_way(
    tmp_path: Path, steps: list[str], kept: list[int], note: str
) -> None:
    rows = "".join(f"x,{s},5,0\n" for s in steps)
    rows = "direction,step,force_N,displacement_mm\n" + rows
    dataset = bring(tmp_path, rows, example.META_SPECIMEN)
    assert dataset.columns["step"].tolist() == kept
    assert [e["text"] for e in dataset.events if e["kind"] == "note"] == ([note] if note else [])


def test_progress_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csvblocks, "BLOCK_BYTES", 100)
    seen: list[tuple[str, float]] = []
    bring(tmp_path, TABLE, out=tmp_path / "o.h5", progress=lambda *a: seen.append(a))
    assert len(seen) > 3
    assert seen[-3:] == [("reading", 1.0), ("writing", 0.0), ("writing", 1.0)]
    read = [fraction for what, fraction in seen if what == "reading"]
    assert read == sorted(read)


# ------------------------------------------------------------------ what is refused, word for word

HEAD = "time_s,direction,repetition,branch,step,force_N,displacement_mm\n"
GOOD = "0,x,1,zero,0,0,0\n"
REFUSED: list[tuple[str | bytes, str]] = [
    (
        "",
        ": empty; wanted: a first row with the names of the columns, force_N and "
        "displacement_mm at least.",
    ),
    (
        "# only a comment\n",
        ": no header row; wanted: a first row with the names of the columns, "
        "force_N and displacement_mm at least.",
    ),
    (
        "0,1.5,2\n1,2,3\n",
        ":1: no header row: the first row holds numbers (0, 1.5, 2 ...); wanted: "
        "the names of the columns, force_N and displacement_mm at least.",
    ),
    (HEAD, ": no samples; there is nothing below the header."),
    (
        "force_N;displacement_mm\n1,5;2,5\n",
        ":1: the columns are separated by semicolons; wanted: "
        "commas between the columns and a point as decimal mark. Save the table so, or replace the "
        "characters.",
    ),
    (
        "force_N\tdisplacement_mm\n1\t2\n",
        ":1: the columns are separated by tabs; wanted: commas "
        "between the columns and a point as decimal mark. Save the table so, or replace the "
        "characters.",
    ),
    (
        "force_N,displacement_mm\n1,5,2,5\n",
        ":2: 4 cells, but the header names 2 columns. If the "
        "numbers have decimal commas, write points instead.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,10,5,1,25\n",
        ":3: 9 cells, but the header names 7 columns. If "
        "the numbers have decimal commas, write points instead.",
    ),
    (
        "force_N,displacement_mm,time_s,step\n1,5,2,0,3\n",
        ":2: 5 cells, but the header names 4 "
        "columns. If the numbers have decimal commas, write points instead.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,10,1,a,b\n",
        ":3: 9 cells, but the header names 7 columns. "
        "Remove what is too much, or name it in the header.",
    ),
    (
        "force_N,displacement_mm\n1;5\n",
        ":2: 1 cell, but the header names 2 columns; wanted: "
        "commas between the cells, not semicolons.",
    ),
    (
        "force_n,displacement_mm\n1,5\n",
        ": the column force_N is missing; the header has force_n, "
        'displacement_mm. Is it "force_n"? Rename it.',
    ),
    (
        "force_kN,displacement_mm\n1,5\n",
        ": the column force_N is missing; the header has force_kN, "
        'displacement_mm. Is it "force_kN"? Convert its values to N, then rename it.',
    ),
    (
        f"{','.join(f'c{i}' for i in range(1, 15))}\n" + "1," * 13 + "1\n",
        ": the column force_N is missing; the header has c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, "
        "c11, c12, and 2 more.",
    ),
    (
        "force_N,time_s\n1,5\n",
        ": the column displacement_mm is missing; the header has force_N, time_s.",
    ),
    (
        "force_N,displacement_mm,force_N\n1,5,1\n",
        ':1: the column "force_N" is there twice (columns 1 and 3); rename or remove one.',
    ),
    ("force_N,displacement_mm,\n1,5,\n", ":1: column 3 has no name (a comma too many?); name it."),
    (
        HEAD + GOOD + "1,x,1,loading,1,10\n",
        ":3: 6 cells, but the header names 7 columns; nothing "
        "for displacement_mm. Was the file cut off? Complete or remove the row.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,10,a note,1\n",
        ":3: 8 cells, but the header names 7 columns. "
        "Remove what is too much, or name it in the header.",
    ),
    (
        HEAD + GOOD + "\n# pause\n1,x,1,loading,1,ten,1\n",
        ':5: column force_N: "ten" is not a '
        "number; wanted: a number in N, with a point as decimal mark.",
    ),
    (
        HEAD + GOOD + '1,x,1,loading,1,"10,5",1\n',
        ':3: column force_N: "10,5" is not a number; '
        'wanted: a number in N, with a point as decimal mark. Write "10.5".',
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,10.5 N,1\n",
        ':3: column force_N: "10.5 N" is not a number; '
        'wanted: a number in N, with a point as decimal mark. Write "10.5"; the unit stands in the '
        "column's name.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,1_0,1\n",
        ':3: column force_N: "1_0" is not a number; wanted: '
        "a number in N, with a point as decimal mark.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,True,1\n",
        ':3: column force_N: "True" is not a number; '
        "wanted: a number in N, with a point as decimal mark.",
    ),
    (
        HEAD + "1,x,1,loading,1,true,1\n",
        ':2: column force_N: "true" is not a number; wanted: a '
        "number in N, with a point as decimal mark.",
    ),
    (
        HEAD + GOOD + '1,x,1,loading,"1,5",5\n',
        ":3: 6 cells, but the header names 7 columns; "
        "nothing for displacement_mm. Was the file cut off? Complete or remove the row.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,,1\n",
        ":3: column force_N: an empty cell is not allowed; every row needs a finite value."
        " Leave rows without one out of the table.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,5,nan\n",
        ':3: column displacement_mm: "nan" (mm) is not allowed; every row needs a finite value.'
        " Leave rows without one out of the table.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,-inf,0\n",
        ':3: column force_N: "-inf" (N) is not allowed; every row needs a finite value.'
        " Leave rows without one out of the table.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,-2e7,0\n",
        ':3: column force_N: "-2e7" (N) is not allowed; '
        "allowed: -10000000 N to 10000000 N. Is the unit right?",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,1,100001\n",
        ':3: column displacement_mm: "100001" (mm) is '
        "not allowed; allowed: -100000 mm to 100000 mm. Is the unit right?",
    ),
    (
        "force_N,displacement_mm,force_z_N\n1,5,\n1,5,2e7\n",
        ':3: column force_z_N: "2e7" (N) is '
        "not allowed; allowed: -10000000 N to 10000000 N. Is the unit right?",
    ),
    (
        "direction,force_N,displacement_mm,temperature2_C\nx,1,5,\nx,1,5,-60\nx,1,5,25000\n",
        ':4: column temperature2_C: "25000" (degC) is not allowed; allowed: -60 degC to 200 degC. '
        "Is the unit right? Where the sensor failed, leave the cell empty.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1,1e999,0\n",
        ':3: column force_N: "1e999" (N) is not allowed; every row needs a finite value.'
        " Leave rows without one out of the table.",
    ),
    (
        HEAD + GOOD + ",x,1,loading,1,5,0\n",
        ":3: column time_s: an empty cell is not allowed; every row needs a finite value."
        " Leave rows without one out of the table.",
    ),
    (
        HEAD + GOOD + "1,x,1,laoding,1,5,0\n",
        ':3: column branch: "laoding" is not allowed; allowed: '
        'zero, loading, unloading, cycle. Did you mean "loading"?',
    ),
    (
        HEAD + GOOD + "1,x,1,up,1,5,0\n",
        ':3: column branch: "up" is not allowed; allowed: zero, loading, unloading, cycle.',
    ),
    (
        HEAD + GOOD + "1,x,1,,1,5,0\n",
        ":3: column branch: an empty cell is not allowed; allowed: "
        "zero, loading, unloading, cycle.",
    ),
    (
        HEAD + GOOD + "1,z,1,loading,1,5,0\n",
        ':3: column direction: "z" is not allowed; META.yaml does not define it. Known: x, y.',
    ),
    (
        HEAD + GOOD + "1,x,0,loading,1,5,0\n",
        ':3: column repetition: "0" is not allowed; wanted: a whole number, 1, 2, 3 ....',
    ),
    (
        HEAD + GOOD + "1,x,1.5,loading,1,5,0\n",
        ':3: column repetition: "1.5" is not allowed; wanted: a whole number, 1, 2, 3 ....',
    ),
    (
        HEAD + GOOD + "1,x,1,loading,2.5,5,0\n",
        ':3: column step: "2.5" is not allowed; wanted: a whole number, or nothing (continuous).',
    ),
    (
        HEAD + GOOD + "1,x,1,loading,1e40,5,0\n",
        ':3: column step: "1e40" is not allowed; wanted: a whole number, or nothing (continuous); '
        "the largest one is 9007199254740991.",
    ),
    (
        HEAD + GOOD + "1,x,1,loading,-1e40,5,0\n",
        ':3: column step: "-1e40" is not allowed; wanted: a whole number, or nothing (continuous); '
        "the smallest one is -9007199254740991.",
    ),
    (
        HEAD + GOOD + "1,x,99999999999999999999,loading,1,5,0\n",
        ':3: column repetition: "99999999999999999999" is not allowed; wanted: a whole number, '
        "1, 2, 3 ...; the largest one is 9007199254740991.",
    ),
    (
        ",".join(f"c{i}" for i in range(2001)) + "\n",
        ":1: 2001 columns; at most 2000 are read. Remove those that rig does not know: they would "
        "be kept, and not be used.",
    ),
    (
        HEAD + GOOD + '1,x,"1,loading,1,5,0\n',
        ":3: quotes that do not match (unexpected end of "
        "data); a cell in quotes must end in its line.",
    ),
    (
        HEAD.replace("step", "pose") + "1,x,1,zero,P1,5,0\n1,x,1,zero,P2,5,0\n",
        ':3: column pose: "P2" is not allowed; META.yaml does not define it. Known: P1.',
    ),
    (
        HEAD.replace("direction", "name") + GOOD,
        ": the column direction is missing, and META.yaml "
        "defines 2: x, y. Add the column, or leave one in META.",
    ),
    (
        HEAD.encode() + b"0,x,1,zero,0,0,0\n\n0,x,1,\xe4,0,0,0\n",
        ":4: the byte 0xE4 is no UTF-8 text; save the file as UTF-8.",
    ),
    (HEAD.encode() + b"0,x,1,zero,0,0,0\n0,x,\x00,", ":3: binary data; a text file is wanted."),
    (bytes(range(256)), ":1: binary data; a text file is wanted."),
    (HEAD.encode("utf-16"), ": UTF-16 text; save it as CSV UTF-8."),
    (b"PK\x03\x04\x14\x00", ": an Excel or zip file; save the sheet as CSV (UTF-8)."),
    (
        HEAD.replace("step", "discarded") + "0,x,1,zero,2,0,0\n",
        ':2: column discarded: "2" is not allowed; wanted: 0 or 1.',
    ),
]


@pytest.mark.parametrize(("table", "message"), REFUSED)
def test_refused_tables(tmp_path: Path, table: str | bytes, message: str) -> None:
    with pytest.raises(InputError) as told:
        bring(tmp_path, table)
    text = str(told.value).replace(str(tmp_path / "META.yaml"), "META.yaml")
    assert text == f"{tmp_path / 't.csv'}{message}"


def test_what_no_arm_is_may_be_hot(tmp_path: Path) -> None:
    rows = "force_N,displacement_mm,temperature1_C\n1,5,650\n"
    assert bring(tmp_path, rows, example.META_SPECIMEN).columns["temperature1_C"] == [650]
    with pytest.raises(InputError, match=r"allowed: -273\.15 degC to 3000 degC"):
        bring(tmp_path, rows.replace("650", "-300"), example.META_SPECIMEN)


def test_lines_are_counted_through_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csvblocks, "BLOCK_BYTES", 50)
    rows = ("# c\n\n" + GOOD) * 30
    table = "# head\n" + HEAD + rows + GOOD.replace("zero", "zeor") + GOOD
    with pytest.raises(InputError, match=r"t\.csv:93: column branch: \"zeor\""):
        bring(tmp_path, table)
    table = "# head\n" + HEAD + rows + GOOD.replace("0,0,0", "0,x,0") + GOOD
    with pytest.raises(InputError, match=r"t\.csv:93: column force_N: \"x\""):
        bring(tmp_path, table)


def test_a_pose_column_without_an_arm(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'pose: "P1" is not allowed; robot: none in .* no poses'):
        bring(tmp_path, "pose,force_N,displacement_mm\nP1,1,2\n", example.META_SPECIMEN)


def test_missing_files(tmp_path: Path) -> None:
    (tmp_path / "META.yaml").write_text(example.META)
    with pytest.raises(InputError, match=r"none\.csv: cannot be read: no such file"):
        import_table(tmp_path / "none.csv", tmp_path / "META.yaml")
    with pytest.raises(InputError, match=r"none\.yaml: no such file"):
        import_table(tmp_path / "none.csv", tmp_path / "none.yaml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        import_table(tmp_path, tmp_path / "META.yaml")


@pytest.mark.parametrize("name", ["z.csv", "z", "z.h5.bak"])
def test_a_data_set_is_named_as_one(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError) as caught:
        bring(tmp_path, TABLE, out=tmp_path / name)
    assert str(caught.value) == (
        f"{tmp_path / name}: a data set is an HDF5 file; allowed endings: .h5, .hdf5. "
        f"Choose another name with -o, such as {'z.h5.h5' if 'bak' in name else 'z.h5'}."
    )
    assert not (tmp_path / name).exists()
    bring(tmp_path, TABLE, out=tmp_path / "Z.HDF5")


def test_measurements_are_never_written_over(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    write(example.dataset(), out)
    before = out.read_bytes()
    with pytest.raises(InputError, match="exists and is no imported data set"):
        bring(tmp_path, TABLE, out=out)
    assert out.read_bytes() == before
    example.write_journal(tmp_path / "busy.h5", 1)
    with pytest.raises(InputError, match="a measurement is under way there"):
        bring(tmp_path, TABLE, out=tmp_path / "busy.h5")
    bring(tmp_path, TABLE, out=tmp_path / "new.h5")
    again = bring(tmp_path, TABLE.replace("10.1", "10.2"), out=tmp_path / "new.h5")
    assert equal(load(tmp_path / "new.h5"), replace(again, path=tmp_path / "new.h5"))


def test_the_same_table_and_meta_are_the_same_data_set(tmp_path: Path) -> None:
    """Whatever the files are called; another value or another META makes another one."""
    first = bring(tmp_path, TABLE).uuid
    (tmp_path / "t.csv").rename(tmp_path / "other.csv")
    assert import_table(tmp_path / "other.csv", tmp_path / "META.yaml").uuid == first
    others = {bring(tmp_path, TABLE.replace("10.1", "10.2")).uuid}
    others.add(bring(tmp_path, TABLE, example.META + "# remark\n").uuid)
    assert len(others | {first}) == 3


# ------------------------------------------------------------------ the two readers agree

NUMBERS = st.one_of(
    st.floats().map(repr),
    st.integers(-(10**25), 10**25).map(str),
    st.from_regex(r"[-+]?[0-9]{0,3}[.,]?[0-9]{0,3}([eE][-+]?[0-9]{0,4})?", fullmatch=True),
    st.sampled_from(
        [
            *csvcells.MISSING,
            "inf",
            "-Infinity",
            "1_0",
            "0x1p3",
            "1e",
            "--1",
            "1 2",
            "x",
            "True",
            "1.5N",
            "٣",
            "1d5",
            "1f",
            "½",
            "- 1",
            "1e+",
            "+.5",
            ".",
        ]
    ),
)


@one_example(cells=[("24364748235606261760", ""), ("1_0", "")])
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cells=st.lists(st.tuples(NUMBERS, st.text("xyzäNA10 ", max_size=4)), min_size=1, max_size=3))
def test_fast_and_plain_reader_agree(
    tmp_path_factory: pytest.TempPathFactory, cells: list[tuple[str, str]]
) -> None:
    path = tmp_path_factory.mktemp("agree") / "t.csv"
    rows = "".join(f'"{a}","{b}",1\n' for a, b in cells)
    path.write_text("a_N,word,c\n" + rows)
    readings: dict[str, csvcells.Reading] = {"a_N": "number", "word": "word", "c": "further"}
    with csvblocks.CsvFile(path) as file:
        (block,) = file.blocks()
        fast = csvcells._parse_fast(file, block, readings)
        try:
            plain = csvcells._parse_plain(file, block, readings)
        except InputError:
            assert fast is None
            return
    if fast is not None:
        for name, values in plain.items():
            assert example.same_values(values, fast[name]), name


@pytest.mark.parametrize("clock", ["session_s", "time_s"])
def test_rows_out_of_order_are_refused(tmp_path: Path, clock: str) -> None:
    def table(times: Iterable[float]) -> str:
        rows = "".join(f"{t},{i},{i / 7!r}\n" for i, t in enumerate(times))
        return f"{clock},force_N,displacement_mm\n" + rows

    mixed = np.random.default_rng(2).permutation(40).tolist()
    with pytest.raises(InputError, match=f"not in the order of measurement: {clock} goes back"):
        bring(tmp_path, table(mixed), example.META_SPECIMEN)
    with pytest.raises(InputError, match=f"{clock} counts down, from 39 to 0 s"):
        bring(tmp_path, table(range(39, -1, -1)), example.META_SPECIMEN)


@pytest.mark.parametrize("each", [2, 4, 8])
@pytest.mark.parametrize("clock", ["session_s", "time_s"])
def test_a_clock_may_start_anew_with_every_step_or_day(
    tmp_path: Path, clock: str, each: int
) -> None:
    rows = "".join(f"{0.5 + i % each},{i},{i / 7!r}\n" for i in range(48))
    table = f"{clock},force_N,displacement_mm\n" + rows
    assert len(bring(tmp_path, table, example.META_SPECIMEN).columns["force_N"]) == 48
