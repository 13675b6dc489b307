"""What a written protocol asks of the operator: times as people set them, limits as they were."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from rig.diagnosis.next_protocol import _rate_Hz, _seconds
from rig.protocol_write import limit_lines


@pytest.mark.parametrize(
    ("duration_s", "written"),
    [(0.0, "0"), (6.0, "6"), (8.2298, "8.3"), (9.97, "10"), (35.015, "36"), (54.865, "55")],
)
def test_times_are_written_as_people_set_them(duration_s: float, written: str) -> None:
    assert _seconds(duration_s) == written


@pytest.mark.parametrize(("measured_s", "rate_Hz"), [(0.914, 1.0), (1.2, 1.0), (0.1, 10.0)])
def test_slots_that_were_late_do_not_make_another_rate(measured_s: float, rate_Hz: float) -> None:
    design: Any = SimpleNamespace(sample_s=measured_s)
    old: Any = SimpleNamespace(sampling=SimpleNamespace(rate_Hz=1.0))
    assert _rate_Hz(design, old) == pytest.approx(rate_Hz)
    assert _rate_Hz(design, None) == float(f"{1 / measured_s:.2g}")  # as people set it


@pytest.mark.parametrize(
    ("allowed_N", "written"), [(None, 258), (240.0, 240), (300.0, 258), (221.0, 258)]
)
def test_a_limit_is_not_raised_without_need(allowed_N: float | None, written: int) -> None:
    before = {} if allowed_N is None else {"most_N": allowed_N}
    assert f"  force_N: {{max: {written}, at: stop}}" in limit_lines(220.0, "9", **before)
