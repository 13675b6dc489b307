"""Tables that go out, and come in again; broken and real ones."""

from __future__ import annotations

import random
import sys
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rig.dataset import Dataset, equal, load, write
from rig.errors import InputError
from rig.tables import import_table
from rig.tables_out import export_table
from tests.unit import example_data as example
from tests.unit.example_data import TABLE, bring

SHARED = Path(__file__).parents[3] / "shared"


# ------------------------------------------------------------------ and out again


def there_and_back(data: Dataset, folder: Path) -> Dataset:
    export_table(data, folder / "e.csv")
    (folder / "E.yaml").write_text(data.texts["meta"])
    return import_table(folder / "e.csv", folder / "E.yaml")


def test_export_gives_a_measurement_back(tmp_path: Path) -> None:
    data = example.dataset(4)
    data.columns["discarded"][2] = True
    back = there_and_back(data, tmp_path)
    assert set(back.columns) == set(data.columns)
    for name, values in data.columns.items():
        assert np.array_equal(values, back.columns[name], equal_nan=values.dtype.kind == "f"), name


def test_marks_survive_the_table(tmp_path: Path) -> None:
    data = example.dataset(2)
    text = (tmp_path / "e.csv", there_and_back(data, tmp_path))
    assert text[0].read_text().startswith("# EMULATED: these values come from simulated devices")
    assert text[1].origin == "emulated"
    cut = there_and_back(replace(data, complete=False, stop_reason="a, b\nc"), tmp_path)
    assert not cut.complete
    clean = there_and_back(replace(data, origin="measured"), tmp_path)
    assert (clean.origin, clean.complete) == ("imported", True)
    write(text[1], tmp_path / "e.h5")
    assert load(tmp_path / "e.h5").origin == "emulated"


newtons, millimetres = st.floats(-4e5, 4e5), st.floats(-1e5, 1e5)
radians = st.floats(-0.3, 0.5) | st.just(nan)  # beside the pose of META


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    rows=st.lists(
        st.tuples(
            newtons,
            millimetres,
            radians,
            st.integers(-1, 2**40),
            st.sampled_from(["x", "y"]),
            st.sampled_from(["zero", "loading", "cycle"]),
            st.booleans(),
            st.text("aä,;\"'# é|", max_size=5).map(str.strip),
        ),
        min_size=1,
        max_size=20,
    )
)
def test_round_trip_is_exact(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[Any, ...]]
) -> None:
    force, displacement, q, step, direction, branch, discarded, note = zip(*rows, strict=True)
    folder = tmp_path_factory.mktemp("trip")
    data = bring(folder, "direction,force_N,displacement_mm\n" + "x,0,0\n" * len(rows))
    columns = data.columns | {
        "force_N": np.array(force),
        "displacement_mm": np.array(displacement),
        "q1_rad": np.array(q),
        "step": np.array(step),
        "direction": np.array(direction),
        "branch": np.array(branch),
        "discarded": np.array(discarded),
        "note": np.array([f"n{text}" for text in note]),
    }
    back = there_and_back(replace(data, columns=columns), folder)
    for name, values in columns.items():
        assert example.same_values(values, back.columns[name]), name


def test_parquet(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    data = example.dataset(4)
    export_table(data, tmp_path / "e.parquet")
    table = parquet.read_table(tmp_path / "e.parquet")
    assert table["force_N"].to_pylist() == [0, 10, 20, 30]
    assert table.schema.field("force_N").metadata == {b"units": b"N"}
    assert table.schema.metadata[b"rig.origin"] == b"emulated"
    assert table.schema.metadata[b"rig.banner"].startswith(b"EMULATED:")
    frame = table.to_pandas()
    assert frame["branch"].tolist() == data.columns["branch"].tolist()


def test_parquet_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match="Install it with `pip install pyarrow`, or write CSV"):
        export_table(example.dataset(), tmp_path / "e.parquet")


def test_other_endings_are_refused(tmp_path: Path) -> None:
    for name in ("e.xlsx", "e", "run.h5"):
        with pytest.raises(InputError, match=r"is not known; allowed: \.csv, \.parquet"):
            export_table(example.dataset(), tmp_path / name)


# ------------------------------------------------------------------ broken ones, and real ones


def _broken_table(text: str, seed: int) -> bytes:
    rng = random.Random(seed)
    lines = text.splitlines(keepends=True)
    row = rng.randrange(len(lines))
    cells = lines[row].rstrip("\n").split(",")
    cell = rng.randrange(len(cells))
    match seed % 10:
        case 0:
            del cells[cell]
        case 1:
            cells.insert(cell, "7")
        case 2:
            cells[cell] = rng.choice(["", "nan", "x", "1,5", "1;5", "-", '"', "0x10", "é", "1e999"])
        case 3:
            lines = [",".join(c for i, c in enumerate(x.split(",")) if i != 7) for x in lines]
        case 4:
            lines = [x.replace(",", rng.choice([";", "\t", "|", ", ,"])) for x in lines]
        case 5:
            raw = bytearray(text.encode())
            for _ in range(3):
                raw[rng.randrange(len(raw))] = rng.randrange(256)
            return bytes(raw)
        case 6:
            return text.encode()[: rng.randrange(len(text))]
        case 7:
            return text.encode("utf-16") if seed % 20 == 7 else rng.randbytes(300)
        case 8:
            lines[0] = lines[0].replace(rng.choice(lines[0].strip().split(",")), "time_s", 1)
        case _:
            return (text + text).encode()
    if seed % 10 < 3:
        lines[row] = ",".join(cells) + "\n"
    return "".join(lines).encode()


SOME_OR_MANY = pytest.mark.parametrize("many", [60, pytest.param(400, marks=pytest.mark.slow)])


@SOME_OR_MANY
def test_broken_tables_are_refused_by_name(tmp_path: Path, many: int) -> None:
    passed = 0
    (tmp_path / "META.yaml").write_text(example.META)
    for seed in range(many):
        (tmp_path / "t.csv").write_bytes(_broken_table(TABLE, seed))
        told = _message(tmp_path / "t.csv", tmp_path / "META.yaml")
        assert told == "" or told.startswith(str(tmp_path / "t.csv")), seed
        passed += not told  # a digit for a digit, a row less: no table can tell
    assert passed < 0.3 * many


@SOME_OR_MANY
def test_broken_metas_are_refused_by_name(tmp_path: Path, many: int) -> None:
    passed = 0
    for seed in range(many):
        rng = random.Random(seed)
        raw = bytearray(example.META.encode())
        at = rng.randrange(len(raw))
        if seed % 4 == 0:
            del raw[at : at + rng.randrange(1, 40)]
        elif seed % 4 == 1:
            raw[at] = rng.randrange(256)
        elif seed % 4 == 2:
            del raw[at:]
        else:
            raw[at:at] = rng.choice([b"\t", b": ", b"- ", b"-", b"\x00", b".nan", b"{", b"&a"])
        (tmp_path / "t.csv").write_text(TABLE)
        (tmp_path / "META.yaml").write_bytes(raw)
        told = _message(tmp_path / "t.csv", tmp_path / "META.yaml")
        assert told == "" or str(tmp_path) in told, seed
        passed += not told
    assert passed < 0.3 * many


def _message(table: Path, meta: Path) -> str:
    try:
        import_table(table, meta)
    except InputError as error:
        return str(error)
    return ""


SHARED_TABLES = sorted(p.parent for p in SHARED.glob("*/*/meta.yaml"))


@pytest.mark.skipif(not SHARED_TABLES, reason="no tables beside the project")
@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_tables_beside_the_project_come_in_and_go_out(tmp_path: Path, every: int) -> None:
    for folder in SHARED_TABLES[::every]:
        table = folder / "samples.csv"
        data = import_table(table, folder / "meta.yaml", tmp_path / "i.h5")
        assert data.rows == len(table.read_text().splitlines()) - 1
        assert [e["kind"] for e in data.events] == ["import"], folder
        assert equal(load(tmp_path / "i.h5"), data), folder
    export_table(data, tmp_path / "o.csv")
    back = import_table(tmp_path / "o.csv", folder / "meta.yaml")
    assert all(example.same_values(v, back.columns[n]) for n, v in data.columns.items())
