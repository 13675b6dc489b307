"""Whether a recording rests at levels: a reduction to curves and a diagnosis agree on it."""

from __future__ import annotations

import pytest

from identification.gap.holds import hold_ids, is_continuous
from rig.gap_data import gap_data
from rig.passes import is_held
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy


@pytest.mark.parametrize("name", DESIGNS)
def test_reduction_and_diagnosis_agree_on_what_is_held(name: str) -> None:
    design = DESIGNS[name]
    dataset = imported(noisy(design), meta(design))
    columns, data = dataset.columns, gap_data(dataset)
    runs = []
    for run in range(int(data.run.max()) + 1):
        mine = data.run == run
        runs.append((columns["branch"][mine], columns["step"][mine], columns["force_N"][mine]))
    held = is_held(runs)
    assert held is not design.continuous
    assert is_continuous(data, hold_ids(data)) is not held
