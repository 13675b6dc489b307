"""Units that stiffnesses smell of."""

from __future__ import annotations

from math import log

from identification.slips import slip


def test_a_factor_that_a_unit_makes() -> None:
    assert slip(log(0.2), 0.16) == "forces in lbf"
    assert slip(log(0.075), 0.16) == "forces in kgf or daN"
    assert slip(log(1300), 0.16) == "displacements in m or forces in mN"
    assert slip(log(0.2), 0.02) is None  # 0.225 is too far away
    assert slip(log(0.7), 0.4) is None  # no factor at all
