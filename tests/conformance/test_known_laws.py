"""What is reported of a law whose coefficients are known, word by word, in numbers.

A shape is looked up, its law gets coefficients in SI units, and what that does to the channels is
fitted by the shape. What is reported then is compared with numbers that were worked out by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from identification.gap.answer.parameters import parameters
from identification.gap.effects import EFFECTS
from identification.gap.evidence.parts import Part
from identification.gap.words import WORDS
from tests.conformance.effect_benches import of
from tests.conformance.gap_designs import STATED, TOP_N

K = float(STATED[0])  # Nm/rad
LEVER_M = 0.7559  # of joint 1 in pose P1 under a push along y
TOP_NM = LEVER_M * TOP_N["y"]
SESSION_S = 2590.5  # from the first sample of the design to its last
# A stand of 1.5e5 Nm/rad at a lever of 0.75 m is as soft as what slips is compared with.
SLIP_M_PER_N, HEIGHT_M = 0.75**2 / 1.5e5, 0.457


@dataclass(frozen=True)
class Known:
    """label of a shape on the design "rich", coefficients of its law in SI units, what is
    reported in the units of the report, and how nearly."""

    label: str
    coefficients: tuple[float, ...]
    reported: dict[str, float]
    nearly: float = 2e-3


KNOWN: dict[str, Known] = {
    "joint_yield": Known(
        "joint 1 at 0.97 sharp",
        (3e-5,),
        {
            "threshold": 0.97 * TOP_NM,
            "onset_y": 0.97 * TOP_N["y"],
            "slope_beyond_over_elastic": 3e-5 * K,
        },
    ),
    "joint_backlash": Known(
        "joint 3 weight tool 0 kg soft zone 0.004", (4e-4, 0.0), {"width": 4e-4}
    ),
    "joint_nonlinear_stiffness": Known(  # the slope of c tau |tau| is 2 c |tau|
        "joint 1 quadratic",
        (1e-7,),
        {"change_of_compliance_over_range": 2 * 1e-7 * TOP_NM * K},
    ),
    "joint_hysteresis": Known(  # strengths are shares of the range, pushed along x to along y
        "joint 1 r 0.06",
        (8e-6, 0.0),
        {"friction": 8e-6 * K * 0.06 * 71.66, "share_through_friction": 8e-6 * K},
    ),
    "joint_creep": Known(
        "joint 1 T 122 s",
        (8e-6, 0.0),
        {
            "creep_fraction": 8e-6 * K,
            "run": 142.0,
            "creep_fraction_of_run": 8e-6 * K * (1 - np.exp(-142 / 121.5)),
            "retardation_time": 121.5,
        },
    ),
    "link_flexibility": Known(  # an even tube, twisted less than it bends
        "segment 1",
        (1.2, 1.2, 1.2, 0.7),
        {
            "bending_compliance_over_nominal_segment1": 1.2,
            "twist_compliance_over_nominal_segment1": 0.7,
        },
    ),
    "base_compliance": Known("axis x 0 m below", (2e-6,), {"compliance_about_x": 2e-6}),
    "base_slip": Known(
        "axis x 0 m below at 0.97 sharp",
        (2e-5,),
        {
            "threshold": 0.97 * HEIGHT_M * TOP_N["y"],
            "onset_y": 0.97 * TOP_N["y"],
            "slope_beyond_over_elastic": 2e-5 * HEIGHT_M**2 / SLIP_M_PER_N,
        },
    ),
    "contact_seating": Known(
        "exponential 0.4",
        (5e-5,),
        {"depth": 0.05 * (1 - np.exp(-1 / 0.4)), "force_scale": 0.4 * TOP_N["x"]},
    ),
    "load_misalignment": Known(
        "direction x", (0.02, -0.03), {"tangent_x_1": 0.02, "tangent_x_2": -0.03}
    ),
    "force_drift": Known("linear", (1e-4,), {"drift_over_session": 1e-4 * SESSION_S}),
    "force_scale": Known("gain", (0.1,), {"factor": 1 / (1 - 0.1)}),  # of what is shown
    "displacement_scale": Known("gain", (-0.1,), {"factor": 1 / (1 + 0.1)}),
    "thermal_drift": Known(
        "linear",
        (2e-8, -3e-8),
        {
            "drift_over_session_x": 2e-5 * SESSION_S,
            "drift_over_session_y": -3e-5 * SESSION_S,
        },
    ),
    "zero_shift": Known("jump before run 2", (2e-5,), {"shift_before_run2": 0.02}),
    # a lag of a sample shows as the delay that it is; of longer ones the kinds say different ones
    "time_lag": Known("displacement delay 1 s", (1.0,), {"lag": 1.0}),
    "pose_error": Known(
        "tool 10 mm", (1e-3, 2e-3, -3e-3), {"offset_x": 1.0, "offset_y": 2.0, "offset_z": -3.0}
    ),
    "joint_stiffness_error": Known("joint 1", (0.25 / K,), {"factor_joint1": 1 / 1.25}),
}


@pytest.mark.parametrize("word", WORDS)
def test_reported_numbers_are_those_of_the_law(word: str) -> None:
    known, laws = KNOWN[word], EFFECTS[word].laws
    bench, variants, columns = of(word, "rich")
    (v,) = (v for v in variants if v.label == known.label)
    law, _ = laws.of(bench, v)
    does = laws.rows(bench, law) @ np.array(known.coefficients)
    mine = columns[:, list(v.columns)]
    scale = np.abs(mine).max(axis=0)
    w = np.linalg.lstsq(mine / scale, does, rcond=None)[0] / scale
    found = parameters(bench, Part(v, v.scales[0]), w, 1e-12 * np.diag(w**2))
    assert {name: p.value for name, p in found.items()} == pytest.approx(
        known.reported, rel=known.nearly, abs=1e-9
    )
