"""What was recorded before it had come to rest is said beside the diagnosis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rig.dataset import Origin, load
from rig.gap_data import gap_data
from rig.tables import import_table
from tests.unit.test_cli import META, TABLE


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
