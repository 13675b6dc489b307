"""What a diagnosis says of data that show little: not at rest, no force, nothing wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.gap.answer import found_notes
from identification.gap.answer.found_notes import disbelieved
from identification.gap.diagnose import diagnose_gap
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.model.bench import make_bench
from identification.gap.recording.imposed import displacement_imposed
from rig.dataset import Origin, load
from rig.diagnosis.diagnose import diagnose
from rig.diagnosis.gap_data import gap_data
from rig.tables import import_table
from tests.conformance.effect_benches import quick_engine
from tests.conformance.gap_designs import DESIGNS, imported, linear, meta, noisy
from tests.unit.cli_bench import META, TABLE
from tests.unit.test_gap_operators import bench_data


@pytest.mark.parametrize(("origin", "advice"), [("emulated", "--speed"), ("measured", "more time")])
def test_what_had_not_settled_is_said(tmp_path: Path, origin: Origin, advice: str) -> None:
    (tmp_path / "t.csv").write_text(TABLE)
    (tmp_path / "m.yaml").write_text(META)
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    dataset = load(tmp_path / "d.h5")
    assert not any("settled" in n for n in gap_data(dataset).notes)
    events = [{"kind": "step_start"}, {"kind": "not_settled"}, {"kind": "step_start"}]
    (note,) = gap_data(replace(dataset, events=events, origin=origin)).notes
    assert note.startswith("At 1 places (of 2 steps, and zero plateaus) nothing had settled")
    assert advice in note


def test_what_makes_k_doubtful_is_said_of_the_diagnosis_too(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(META)
    late = TABLE.replace("displacement_mm\n", "displacement_mm,slots_missed,settled\n")
    rows = late.splitlines()
    told = [rows[0], *(f"{row},{int(i == 3)},{int(i != 9)}" for i, row in enumerate(rows[1:]))]
    told[6] = "16,1,zero,0,11.0,0.0,20,1"  # at the end of the first run, which goes up to 100 N
    (tmp_path / "t.csv").write_text("\n".join(told) + "\n")
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    missed, still, zero = gap_data(load(tmp_path / "d.h5")).notes
    assert missed.startswith("54 % of the sampling slots were missed (21 of 39)")
    assert missed.endswith("leaves what looks like lost motion, friction or a joint that gave way.")
    assert still.startswith("1 of 14 levels had not settled when they were sampled. What still")
    assert zero.startswith("The force at zero load moved by 11.0 N within a run (x, repetition 1)")
    assert zero.endswith("look for what did it before you believe in an effect of the rig.")


def test_a_repetition_that_was_resumed_midway_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TABLE)
    (tmp_path / "m.yaml").write_text(META)
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    dataset = load(tmp_path / "d.h5")
    repetition = dataset.columns["repetition"]
    segment = repetition.copy()
    segment[np.flatnonzero(repetition == 2)[-3:]] = 9
    data = gap_data(replace(dataset, columns={**dataset.columns, "segment": segment}))
    assert 2 in gap_data(dataset).repetition
    assert 2 not in data.repetition
    assert any("Repetition 2 was interrupted and taken up again midway" in n for n in data.aside)


def test_a_force_that_never_changes_was_not_answered_to_a_stroke() -> None:
    """Levels in name only: the displacement comes and goes without a force."""
    step = np.tile(np.repeat([0, 1, 2, 1], 6), 3)
    moved, n = 1e-3 * step, len(step)
    data = bench_data(np.zeros(n), moved, step=step, branch=np.where(step > 0, 1, 0))
    assert not displacement_imposed(data)
    assert displacement_imposed(replace(data, imposed="displacement", force=1e5 * moved))


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("rows", [1, 2, 3, 4, 5])
def test_a_few_readings_are_diagnosed_as_nothing(name: str, rows: int) -> None:
    """Of a running recording from where it bears: the first of them unloaded is another matter."""
    design = DESIGNS[name]
    table = noisy(design)
    first = 3 if design.continuous else 0
    data = gap_data(imported(table[first : first + rows], meta(design)))
    assert diagnose_gap(data).verdict in ("none", "unknown")


@pytest.mark.parametrize(
    ("column", "field", "what"),
    [
        ("q3_rad", "q", "joint readings"),
        ("force_y_N", "tangential", "force components"),
    ],
)
def test_a_hole_in_a_column_costs_its_samples_and_not_the_channel(
    column: str, field: str, what: str
) -> None:
    table, count = noisy(DESIGNS["rich"]), len(noisy(DESIGNS["rich"]))
    whole = gap_data(imported(table, meta(DESIGNS["rich"])))
    few, many = table.copy(), table.copy()
    few.loc[[57, 90], column] = np.nan
    data = gap_data(imported(few, meta(DESIGNS["rich"])))
    kept = np.delete(np.arange(count), [57, 90])
    np.testing.assert_array_equal(getattr(data, field), getattr(whole, field)[kept])
    np.testing.assert_array_equal(data.force, whole.force[kept])
    assert f"2 of {count} samples lack {what}: set aside." in data.aside
    many.loc[: count // 2, column] = np.nan
    data = gap_data(imported(many, meta(DESIGNS["rich"])))
    assert getattr(data, field) is None
    assert len(data.force) == count
    note = f"{count // 2 + 1} of {count} samples lack {what}: taken as if none had been recorded."
    assert note in data.notes


@pytest.mark.parametrize(("sensors", "read"), [((1,), 1), ((1, 2), 2), ((1, 3), 1), ((3,), 0)])
def test_a_rig_has_as_many_thermometers_as_it_has(sensors: tuple[int, ...], read: int) -> None:
    design = DESIGNS["bench"]
    table = noisy(design)
    for k in sensors:
        table[f"temperature{k}_C"] = 20.0 + np.arange(len(table)) / len(table)
    data = gap_data(imported(table, meta(design)))
    assert (0 if data.temperature is None else data.temperature.shape[1]) == read
    left = [n for n in data.notes if "not used" in n]
    assert left == [
        "temperature3_C: not used; thermometers count from temperature1_C without gaps."
    ] * (3 in sensors)


@pytest.mark.parametrize("column", ["q3_rad", "temperature2_C"])
def test_no_level_goes_for_a_hole_nor_any_sample_for_a_temperature(column: str) -> None:
    design = DESIGNS["rich"]
    table = noisy(design)
    first = (table.step == table.step[0]) & (table.branch == table.branch[0])
    plateau = table.index[first & (table.repetition == 1)][:4]
    if column in table and column.startswith("q"):  # all of the first level, and no more
        keys = ["pose", "direction", "repetition", "branch", "step"]
        plateau = table.index[(table[keys] == table.loc[0, keys]).all(axis=1)]
    else:
        for k in range(1, 7):
            table[f"temperature{k}_C"] = 20.0
    table.loc[plateau, column] = np.nan
    data = gap_data(imported(table, meta(design)))
    assert len(data.force) == len(table)
    assert (data.q if column.startswith("q") else data.temperature) is None
    assert any("taken as if none had been recorded" in n for n in data.notes)


def test_what_asks_for_too_much_without_any_effect_is_told_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine = quick_engine(make_bench(linear("rich")))
    asks = "the stiffness of a joint 7 standard deviations off what META states"
    monkeypatch.setattr(found_notes, "what_is_strained", lambda *_: asks)
    nothing = Explanation((), 0.0, 0.0, (), 0.0)
    found = cast("SearchResult", SimpleNamespace(engine=engine, explanations=(nothing,)))
    (note,) = disbelieved(found, "unknown")
    assert note.text.startswith(f"Without any effect, the best fit asks for {asks}: it was not")


def test_where_nothing_is_wrong_no_place_is_named(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TABLE)
    (tmp_path / "m.yaml").write_text(META)
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    found = diagnose(load(tmp_path / "d.h5"))
    assert found.result.verdict == "none"
    assert "Where" not in found.to_text()
    assert "joint" not in found.to_text().splitlines()[0]  # it has none
    where = found.to_json()["where"]
    assert where["directions"] == where["poses"] == []
    assert where["share_of_gap"] == 0.0
