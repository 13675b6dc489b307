"""Data sets: from the journal, into HDF5 and back, read by other programs, never silently wrong."""

from __future__ import annotations

import errno
import json
import os
import random
import subprocess
import sys
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rig.dataset import Dataset, equal, finish, from_records, load, write
from rig.errors import InputError
from rig.journal import Journal, journal_path
from rig.storage import hdf5
from tests.unit import example_data as example


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write(example.dataset(), tmp_path / "run.h5")
    return tmp_path / "run.h5"


# ------------------------------------------------------------------ from the journal


def test_columns_of_a_measurement() -> None:
    data = example.dataset(3)
    assert data.columns["force_N"].tolist() == [0, 10, 20]
    assert data.columns["laser_mm"].tolist() == [5, 5.1, 5.2]
    assert data.columns["branch"].tolist() == ["zero", "loading", "loading"]
    assert data.columns["session_s"].tolist() == [3, 4, 5]
    assert data.columns["number"].tolist() == [3, 4, 5]
    assert data.columns["force_N_errors"].tolist() == [0.02] * 3
    assert np.isnan(data.columns["laser_mm_errors"]).all()
    assert data.columns["laser_count"].tolist() == [100, 101, 102]
    assert data.columns["laser_invalid"].tolist() == [0, 1, 2]
    assert data.columns["robot_age_s"].tolist() == [0.008] * 3
    assert not data.columns["discarded"].any()
    kinds = {n: data.columns[n].dtype.kind for n in ("pose", "repetition", "discarded", "step")}
    assert kinds == {"pose": "U", "repetition": "i", "discarded": "b", "step": "i"}
    assert data.units["laser_mm"] == data.units["laser_mm_errors"] == "mm"
    assert data.units["robot_age_s"] == "s"
    assert data.long_names["laser_mm"] == "distance of the target"
    assert "standard deviation" in data.long_names["laser_mm_errors"]
    assert data.meta.instruments.force.standard_uncertainty_N == 0.1
    assert data.devices["laser"] == {"serial": "4711", "source": "emulated+ild2200"}
    assert data.texts["protocol"].endswith("# Schraube drehen: °\n")
    assert data.complete
    assert data.stop_reason == "done"
    assert data.banners() == (
        "EMULATED: these values come from simulated devices; nothing was measured.",
    )


def test_discarded_samples_stay_and_are_marked() -> None:
    data = from_records(
        example.records(
            6,
            ("event", {"kind": "discard", "text": "", "first": 1, "last": 2, "reason": "redo"}),
            ("sample", example.sample(1)),
        )
    )
    assert data.columns["discarded"].tolist() == [False, True, True, False, False, False, False]
    assert data.used.sum() == 5
    assert data.events[0]["sample"] == 6
    wrong = {"kind": "discard", "text": "", "first": 1, "last": 6, "reason": "redo"}
    with pytest.raises(InputError, match="discards the samples 1 to 6, but there are 6"):
        from_records(example.records(6, ("event", wrong)))


def test_a_value_that_some_samples_lack_is_nan() -> None:
    data = from_records(example.records(2, ("sample", example.sample(2, moment_x_Nm=4.0))))
    assert np.isnan(data.columns["moment_x_Nm"][:2]).all()
    assert data.columns["moment_x_Nm"][2] == 4
    assert data.units["moment_x_Nm"] == "Nm"


def test_without_a_stop_record_it_is_incomplete() -> None:
    cut = from_records(example.records(3))
    assert not cut.complete
    assert cut.banners()[1] == (
        "INCOMPLETE: the measurement did not reach its end (it was cut off)."
    )
    told = ("event", {"kind": "stopped", "text": "laser: silent for 1.0 s. Check it, then resume."})
    banner = from_records(example.records(3, told)).banners()[1]
    assert banner.endswith("its end (laser: silent for 1.0 s).")  # no remedy of that day
    stopped = ("event", {"kind": "stopped", "text": "force limit"})
    assert from_records(example.records(3, stopped)).stop_reason == "force limit"
    stop = ("stop", {"reason": "done", "complete": True})
    resumed = from_records(example.records(3, stop, ("sample", example.sample(3))))
    assert not resumed.complete
    aborted = from_records(example.records(3, ("stop", {"reason": "aborted", "complete": False})))
    assert (aborted.complete, aborted.stop_reason) == (False, "aborted")


def test_a_resumed_run_adds_its_devices() -> None:
    other = example.descriptor()
    other["devices"] = {"laser": {"serial": "4712"}}
    other["signals"] = [{"name": "extra_V", "unit": "V", "long_name": "extra"}]
    data = from_records(example.records(1, ("descriptor", other)))
    assert data.devices["laser"] == {"serial": "4712"}
    assert data.devices["robot"] == {"controller": "5.12"}
    assert data.units["laser_mm"] == "mm"


@pytest.mark.parametrize(
    ("kind", "data", "message"),
    [
        ("sample", {"number": 1}, "journal:4: the sample record|a sample record lacks"),
        ("sample", example.sample(1) | {"step": None}, "a sample record lacks or garbles"),
        ("event", {"text": "x"}, "journal:4: the event record lacks or garbles 'kind'"),
        ("descriptor", {"devices": {}}, "journal:4: the descriptor record lacks .* 'signals'"),
        ("stop", {"complete": True}, "journal:4: the stop record lacks or garbles 'reason'"),
    ],
)
def test_records_that_do_not_fit(kind: str, data: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        from_records(example.records(1, (kind, data)))


def test_start_records_that_do_not_fit() -> None:
    records = example.records(1)
    records[0].data["origin"] = "invented"
    with pytest.raises(InputError, match='origin is "invented"; allowed: measured, emulated'):
        from_records(records)
    records = example.records(1)
    records[0].data["meta"] = "directions: {x: [1, 0, 0]}\n"
    with pytest.raises(InputError, match="meta:1:1: robot"):
        from_records(records)
    with pytest.raises(InputError, match="no start record"):
        from_records(records[1:])


# ------------------------------------------------------------------ file and journal together


def test_the_journal_beside_the_file_is_the_truth(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    example.write_journal(path, 4)
    assert load(path).rows == 4  # no HDF5 file at all
    write(example.dataset(2), path)
    assert load(path).rows == 4  # an older one
    assert not load(path).complete
    path.write_bytes(b"torn")
    assert load(path).rows == 4


def test_a_journal_of_another_run_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write(example.dataset(2), path)
    example.write_journal(path, 4, uuid="another")
    with pytest.raises(InputError, match=r"run\.h5\.journal, belongs to another measurement"):
        load(path)


def test_finish_removes_the_journal_of_a_complete_run_only(tmp_path: Path) -> None:
    for stop, stays in ((True, False), (False, True), (None, True)):
        path = tmp_path / f"{stop}.h5"
        example.write_journal(path, 3, stop=stop)
        data = finish(path)
        assert journal_path(path).exists() == stays
        assert data.complete == (stop is True)
        assert equal(load(path), data)


def test_an_empty_run_is_a_data_set(tmp_path: Path) -> None:
    example.write_journal(tmp_path / "run.h5", 0)
    data = finish(tmp_path / "run.h5")
    assert data.rows == 0
    journal_path(tmp_path / "run.h5").unlink()
    assert equal(load(tmp_path / "run.h5"), data)


# ------------------------------------------------------------------ to HDF5 and back


def test_comes_back_as_it_was_written(path: Path) -> None:
    written, read = example.dataset(path=path), load(path)
    assert equal(written, read)
    assert list(read.columns) == list(written.columns)
    assert read.path == path
    assert read.calibration == {"a_mm": 30.0, "axes": [[1, 0, 0]]}


@pytest.mark.parametrize("most_strings", [200_000, 3])
def test_unusual_names_and_texts_come_back(
    tmp_path: Path, most_strings: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hdf5, "_MOST_STRINGS", most_strings)
    data = example.dataset(5)
    unusual: dict[str, Any] = {
        "v in mm/s": np.arange(5.0),
        "v in mm_s": -np.arange(5.0),
        "time": np.array([1e-300, -0.0, np.inf, np.nan, 5e4]),
        "Bemerkung": np.array(["", "Größe", "a", "b" * 90, "ß"]),
        "Wort": np.array(["", "Größe", "a", "b", "ß"]),
    }
    columns = data.columns | unusual
    units = data.units | dict.fromkeys(unusual, "")
    names = data.long_names | dict.fromkeys(unusual, "")
    data = replace(data, columns=columns, units=units, long_names=names)
    write(data, tmp_path / "x.h5")
    assert equal(load(tmp_path / "x.h5"), data)


def test_columns_of_different_length_are_a_bug(tmp_path: Path) -> None:
    data = example.dataset(5)
    data.columns["force_x_N"] = np.zeros(4)
    with pytest.raises(ValueError, match="force_x_N has the shape"):
        write(data, tmp_path / "x.h5")
    assert list(tmp_path.iterdir()) == []


def test_a_failing_disk_leaves_the_older_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = path.read_bytes()

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    for owner, name in ((hdf5, "_write_manifest"), (os, "fsync"), (Path, "replace")):
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, refuse)
            with pytest.raises(InputError, match=r"run\.h5: cannot be written: No space left"):
                write(example.dataset(7), path)
        assert path.read_bytes() == before
        assert [p.name for p in path.parent.iterdir()] == ["run.h5"]
    with pytest.raises(InputError, match="cannot be written: No such file"):
        write(example.dataset(7), path.parent / "none" / "x.h5")


def test_a_disk_that_fills_up_is_one_error(tmp_path: Path) -> None:
    program = (
        "import resource; from pathlib import Path; from rig.dataset import load, write; "
        "from rig.errors import InputError; data = load(Path('a.h5'));\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))\n"
        "try: write(data, Path('b.h5'))\n"
        "except InputError as error: print(error)"
    )
    write(example.dataset(1000), tmp_path / "a.h5")
    assert (tmp_path / "a.h5").stat().st_size > 60_000
    ended = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert ended.stderr == ""
    reason = os.strerror(errno.EFBIG)
    assert ended.stdout.startswith(f"b.h5: cannot be written: {reason}. Choose another folder")
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


def test_the_new_file_is_on_disk_before_it_takes_its_place(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    real_sync, real_replace = os.fsync, Path.replace

    def sync(fd: int) -> None:
        calls.append("fsync")
        real_sync(fd)

    def put(self: Path, target: Path) -> Path:
        calls.append("replace")
        return real_replace(self, target)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(Path, "replace", put)
    write(example.dataset(), path)
    assert calls == ["fsync", "replace", "fsync"]  # contents, name, folder


# ------------------------------------------------------------------ what other programs see


def test_plain_h5py_and_pandas(path: Path) -> None:
    with h5py.File(path) as file:
        assert file.attrs["Conventions"] == "CF-1.11"
        assert file.attrs["origin"] == file["entry"].attrs["origin"] == "emulated"
        assert file.attrs["title"] == "EMULATED: Steifigkeit längs x"
        assert file["entry/title"].asstr()[()] == "EMULATED: Steifigkeit längs x"
        assert (file.attrs["complete"], file.attrs["schema_version"]) == (1, 1)
        assert datetime.fromisoformat(file.attrs["created"]).utcoffset() is not None
        assert file["entry/devices/laser"].attrs["serial"] == "4711"
        samples = file["entry/samples"]
        force = samples["force_N"]
        assert (force.attrs["units"], force.compression, force.fletcher32) == ("N", "gzip", True)
        assert force[:].tolist() == [0, 10, 20, 30, 40]
        assert samples["branch"].asstr()[1] == "loading"
        assert samples["force_N_errors"].attrs["units"] == "N"
        import pandas as pd

        frame = pd.DataFrame({n: samples[n][:] for n in ("force_N", "displacement_mm")})
    assert frame["displacement_mm"].tolist() == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])


def test_nexus_finds_the_default_plot(path: Path) -> None:
    with h5py.File(path) as file:
        entry = file[file.attrs["default"]]
        group = entry[entry.attrs["default"]]
        assert [file.attrs["NX_class"], entry.attrs["NX_class"]] == ["NXroot", "NXentry"]
        assert group.attrs["NX_class"] == "NXdata"
        signal = group[group.attrs["signal"]]
        (axis,) = group.attrs["axes"]
        assert signal.dims[0][0] == group[axis]
        assert group[axis].is_scale
        assert all(c.shape == signal.shape for c in group.values())


def test_xarray_with_time_and_units(path: Path) -> None:
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    with xarray.open_dataset(path, engine="h5netcdf", group="entry/samples") as data:
        assert data.sizes == {"time": 5}
        assert data["force_N"].attrs["units"] == "N"
        assert data["laser_mm"].attrs["long_name"] == "distance of the target"
        assert data["branch"].values.tolist() == ["zero"] + ["loading"] * 4
        assert data["force_N"].sel(time="2026-03-01T09:00:05").item() == 20  # UTC
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        assert "force_N" in tree["entry/samples"]


def test_results_beside_do_no_harm(path: Path) -> None:
    before = load(path)
    with h5py.File(path, "r+") as file:
        file.create_group("entry/results")["k"] = np.arange(10_000.0)
    assert equal(load(path), before)


# ------------------------------------------------------------------ what is wrong with a file


def _change(name: str, value: Any = None, attribute: str = "") -> Any:
    def act(file: h5py.File) -> None:
        if attribute:
            file[name].attrs[attribute] = value
        elif value is None:
            del file[name]
        else:
            file[name][...] = value

    return act


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (_change("entry/samples/force_N"), "damaged: /entry/samples/force_N is missing"),
        (_change("entry/samples/force_N", 1.0), "/entry/samples/force_N has changed since"),
        (_change("entry/samples/pose", "P2"), "/entry/samples/pose has changed since"),
        (_change("entry/samples/laser_mm", "m", "units"), "/entry/samples/laser_mm has changed"),
        (_change("entry/texts/meta", "robot: none"), "/entry/texts/meta has changed"),
        (_change("entry/texts"), "damaged: /entry/texts is missing"),
        (_change("entry/manifest"), "damaged: /entry/manifest is missing"),
        (_change("entry/manifest", "{}"), "/entry/manifest has changed since"),
        (_change("entry/devices/laser", "1", "serial"), "/entry/devices/laser has changed"),
        (_change("/", "measured", "origin"), "damaged: / has changed since it was written"),
        (_change("/", 0, "complete"), "damaged: / has changed since it was written"),
        (_change("/", "rig.other", "schema"), "an HDF5 file of another program"),
        (_change("/", 2, "schema_version"), "written by a newer version .*layouts up to 1"),
    ],
)
def test_every_change_is_told_with_its_place(path: Path, act: Any, message: str) -> None:
    with h5py.File(path, "r+") as file:
        act(file)
    with pytest.raises(InputError, match=message) as told:
        load(path)
    assert str(path) in str(told.value)


def test_a_column_of_another_length(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["entry/samples/force_N"]
        file["entry/samples/force_N"] = np.zeros(4)
    with pytest.raises(InputError, match=r"force_N has the shape \(4,\), not \(5,\)"):
        load(path)


def test_files_that_are_no_data_set(tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    with pytest.raises(InputError) as folder:
        load(tmp_path)
    words = f"{tmp_path}: a folder; a data set (.h5) is wanted. `rig list {tmp_path}` shows"
    assert str(folder.value) == f"{words} those in it."
    with pytest.raises(InputError, match=r"x\.h5: cannot be read: no such file"):
        load(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="an empty file"):
        load(path)
    path.write_text("force_N,displacement_mm\n")
    with pytest.raises(InputError, match="no HDF5 file"):
        load(path)
    with h5py.File(path, "w") as file:
        file["a"] = 1
    with pytest.raises(InputError, match="of another program"):
        load(path)
    table = tmp_path / "x.csv"
    table.write_text("force_N,displacement_mm\n")
    with pytest.raises(InputError, match="`rig import`"):
        load(table)


def test_a_file_that_was_cut_off(path: Path) -> None:
    raw = path.read_bytes()
    path.write_bytes(raw[:5000])
    with pytest.raises(InputError, match=r"damaged: 5000 bytes are left of \d+: cut off while"):
        load(path)
    path.write_bytes(raw + b"more")
    with pytest.raises(InputError, match="damaged: its bytes have changed since it was written"):
        load(path)


def test_what_is_said_to_bring_a_damaged_file_back_does(tmp_path: Path) -> None:
    path = tmp_path / "cut.h5"
    example.write_journal(path, 4, stop=False)
    whole = finish(path)
    journal = journal_path(path).rename(tmp_path / "elsewhere")
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"lay cut\.h5\.journal beside it, if the measurement was"):
        load(path)
    journal.rename(journal_path(path))
    assert equal(load(path), whole)


def _broken(raw: bytes, seed: int) -> bytes:
    """Bits flipped, cut off, zeros or noise written over."""
    rng, data = random.Random(seed), bytearray(raw)
    at = rng.randrange(len(data))
    if seed % 4 == 0:
        for _ in range(rng.choice([1, 1, 3, 20])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif seed % 4 == 1:
        del data[at:]
    elif seed % 4 == 2:
        length = len(data[at : at + rng.randrange(1, 2000)])
        data[at : at + length] = bytes(length)
    else:
        data[at : at + 8] = rng.randbytes(8)
    return bytes(data)


def _load_or_message(path: Path) -> Dataset | str:
    try:
        return load(path)
    except InputError as error:
        return str(error)


def test_200_broken_files_are_refused_by_name(path: Path) -> None:
    raw, whole, harmless = path.read_bytes(), load(path), 0
    for seed in range(200):
        path.write_bytes(_broken(raw, seed))
        got = _load_or_message(path)
        if isinstance(got, str):
            assert got.startswith(str(path)), seed
            continue
        assert path.read_bytes() == raw, seed  # zeros over zeros: nothing was broken
        assert equal(got, whole)
        harmless += 1
    assert harmless < 40


def test_broken_journals_never_give_other_values(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    example.write_journal(path, 20, stop=True)
    journal = journal_path(path)
    raw, whole = journal.read_bytes(), load(path)
    for seed in range(200):
        journal.write_bytes(_broken(raw, seed))
        got = _load_or_message(path)
        if isinstance(got, str):
            assert got.startswith(str(journal)), seed
            continue
        for name, values in got.columns.items():
            assert example.same_values(values, whole.columns[name][: got.rows]), (seed, name)
        assert seed % 4 in (1, 2) or journal.read_bytes() == raw, seed  # only a lost end passes


def test_a_locked_journal_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with Journal.create(journal_path(path), example.start()) as journal:
        journal.append("descriptor", example.descriptor())
        journal.append("sample", example.sample(0))
        assert load(path).rows == 1


def test_events_are_json_for_others(path: Path) -> None:
    event = {"kind": "note", "text": "Pause: Kaffee", "value": 1.5}
    write(from_records(example.records(2, ("event", event))), path)
    with h5py.File(path) as file:
        assert json.loads(file["entry/record/events"].asstr()[()]) == [{"sample": 2, **event}]
