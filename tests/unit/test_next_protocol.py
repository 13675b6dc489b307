"""What a written protocol asks of the operator: times as people set them, limits as they were."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from identification.gap.answer.designs import Design
from identification.gap.data import Instruments
from rig import protocol_before
from rig.diagnosis.next_protocol import (
    _apart,
    _force_band,
    _rate_Hz,
    _seconds,
    _seen_to_the_end,
    _timing,
)
from rig.protocol import load_protocol
from rig.protocol_before import limits_before
from rig.protocol_write import limit_lines, pose_line
from rig.protocolfile import Limit, Limits


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
    before = Limits() if allowed_N is None else Limits(force_N=Limit(max=allowed_N, at="pause"))
    at = "stop" if allowed_N is None else "pause"
    assert f"  force_N: {{max: {written}, at: {at}}}" in limit_lines(220.0, 9.0, before)


def test_what_was_watched_before_is_watched_no_less() -> None:
    before = Limits(
        joint_deviation_deg=Limit(max=3.0, at="stop"),
        force_rate_N_per_s=Limit(max=60.0, at="stop"),
        displacement_rate_mm_per_s=Limit(max=2.0, at="stop"),
        displacement_mm=Limit(max=7.5, at="pause"),
    )
    assert limit_lines(220.0, 9.0, before) == [
        "limits:",
        "  force_N: {max: 258, at: stop}",
        "  displacement_mm: {max: 7.5, at: pause}",
        "  force_rate_N_per_s: {max: 60, at: stop}",
        "  displacement_rate_mm_per_s: {max: 2, at: stop}",
        "  joint_deviation_deg: {max: 3, at: stop}",
        "  joint_temperature_C: {max: 60, at: stop}",
    ]


def test_of_several_data_sets_the_least_that_was_allowed_counts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    each = [
        SimpleNamespace(limits=Limits(force_N=Limit(max=200.0, at="warn"))),
        None,  # an imported table
        SimpleNamespace(
            limits=Limits(
                force_N=Limit(max=250.0, at="stop"), joint_temperature_C=Limit(max=50.0, at="warn")
            )
        ),
    ]
    monkeypatch.setattr(protocol_before, "protocol_before", lambda k: each[k])
    assert limits_before(range(3)) == Limits(  # type: ignore[arg-type]
        force_N=Limit(max=200.0, at="stop"), joint_temperature_C=Limit(max=50.0, at="warn")
    )


@pytest.mark.parametrize("longer", ["", "hold_s", "zero_s", "rest_s"])
def test_times_that_a_proposal_leaves_are_those_of_the_protocol(longer: str) -> None:
    """Three of five slots that were missed make other holds and pauses in the data."""
    present = replace(planned((10.0, 20.0)), hold_s=12.0, sample_s=2.4, zero_s=13.0, rest_s=41.0)
    design = replace(present, **({longer: 90.0} if longer else {}))
    old: Any = SimpleNamespace(
        sampling=SimpleNamespace(rate_Hz=1.0, samples_per_step=5),
        hold_s=0.0,
        zero=SimpleNamespace(before_s=6.0, after_s=7.0),
        rest_s=10.0,
        settle=load_protocol(Path("protocols/paper_xy.yaml")).settle,
        step_deadline_s=300.0,
    )
    lines = list(_timing(design, old, present))
    kept = {
        "hold_s": ["hold_s: 0"],
        "zero_s": ["zero: {before_s: 6, after_s: 7}"],
        "rest_s": ["rest_s: 10"],
    }
    for name, written in kept.items():
        assert all((line in lines) is (name != longer) for line in written)
    if longer:
        assert any("90" in line for line in lines)


def planned(*levels: tuple[float, ...]) -> Design:
    return Design(
        setups=(),
        levels=levels,
        repetitions=1,
        unload=True,
        both_senses=False,
        cycles=(1.0,),
        hold_s=5.0,
        sample_s=1.0,
        approach_s=14.0,
        zero_s=6.0,
        rest_s=10.0,
        readings=False,
        components=False,
        instruments=Instruments(0.1, 2e-6, 0.005, 0.003),
    )


@pytest.mark.parametrize(
    ("levels", "absolute_N", "relative"),
    [
        ((20.0, 40.0, 220.0), 0.5, 0.01),  # as in every protocol here
        ((1.6, 3.2, 4.8), 0.4, 0.01),  # a quarter of a step
        ((0.6, 1.2, 60.0), 0.2, 0.15 / 60),  # what a hand can hold
    ],
)
def test_a_band_is_no_finer_than_a_hand_can_hold(
    levels: tuple[float, ...], absolute_N: float, relative: float
) -> None:
    band = _force_band(planned(levels))
    assert band.absolute_N == pytest.approx(absolute_N)
    assert band.relative == pytest.approx(relative)


def test_loading_ends_beyond_all_levels_that_are_to_be_seen() -> None:
    """What flows after the last level that is held would be in no row."""
    design = replace(planned((40.0, 80.0), (60.0, 75.0, 82.0, 90.0), (10.0,)), setups=(None,) * 3)
    reached = (1e-3, 2e-3), (1.2e-3, 2.5e-3, 7e-3, 11e-3), (12e-3,)
    kept, stops = _seen_to_the_end(design, reached, 8.55)
    assert kept.levels == ((40.0, 80.0), (60.0, 75.0, 82.0), (10.0,))
    assert stops == pytest.approx((7.2, 1.15 * 7.0, 8.55))
    assert _seen_to_the_end(design, (), 8.55) == (design, pytest.approx((7.2,) * 3))


def test_levels_that_no_hand_can_set_apart_become_one() -> None:
    design = _apart(planned((0.1, 9.7, 10.0, 20.0), (-0.3, -1.0), (0.05,)))
    assert design.levels == ((10.0, 20.0), (-1.0,), (0.05,))
    half = _force_band(planned(*design.levels[:2])).absolute_N
    assert 10.0 + half < 20.0 - half


def test_poses_are_written_in_degrees_as_in_the_other_protocols() -> None:
    q = [math.radians(a) for a in (13.43, -99.84, -108.1, -62.06, 90.0, -1e-9)]
    assert pose_line("P1", q, (0, 0, 50)) == (
        "  P1: {q_deg: [13.43, -99.84, -108.1, -62.06, 90, 0], tcp_xyz_mm: [0, 0, 50], "
        "program: null}"
    )
