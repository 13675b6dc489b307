"""Effects recover themselves, and the diagnosis says what it can't tell them from.

Through the fit with the form that made the data, and through the whole diagnosis, which names the
word with its parameters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.gap.answer.parameters import parameters
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.evidence.signs import Limits
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.laws.interval import Parameter
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from tests.conformance.effect_benches import (
    PAIRS,
    Array,
    of,
    readings,
)
from tests.conformance.gap_designs import (
    linear,
)
from tests.explained import explained

# --- recovery ----------------------------------------------------------------------------------


def with_effect(design: str, v: Variant, stacked: Array, bench: Bench) -> GapData:
    """The linear data of a design with what a variant does (size,) added to its samples."""
    data, rows = linear(design), bench.rows
    count = rows.weight.astype(int)
    response = np.repeat(stacked[: rows.n], count)
    if v.word == "thermal_drift" and bench.imposed:  # no datum takes what was there at first
        response = response - response[np.unique(data.setup, return_index=True)[1]][data.setup]
    if v.word == "force_drift" and not bench.imposed:  # in the readings, not in the rig
        slope = np.repeat(np.maximum(bench.slope, 1e-300), count)
        return replace(data, force=data.force - response / slope)
    changes: dict[str, Array] = {}
    if bench.imposed:
        stated = np.repeat(bench.lever**2 @ data.compliance, count)
        changes["force"] = data.force + response / stated
    else:
        changes["displacement"] = data.displacement + response
    held = np.cumsum(np.repeat(rows.hold_starts, count) & first_of_rows(count)) - 1
    if bench.has_q and data.q is not None:
        changes["q"] = data.q + readings(bench, stacked[:, None])[:, held, 0].T
    if data.tangential is not None:
        across = stacked[bench.layout.tangential].reshape(2, -1)
        changes["tangential"] = data.tangential + across[:, held].T
    return replace(data, **changes)  # type: ignore[arg-type]


def first_of_rows(count: NDArray[np.int_]) -> NDArray[np.bool_]:
    out = np.zeros(int(count.sum()), dtype=bool)
    out[np.concatenate([[0], np.cumsum(count)[:-1]])] = True
    return out


def strength(bench: Bench, v: Variant, columns: Array, times: float) -> Array:
    """Coefficients of the prior's main direction (of a knee, the knee; of sizes that are free of
    each other, unlike ones) that keep all limits, rms of the response beyond the datum `times` the
    noise."""
    unit = np.ones(len(v.columns))
    if v.each:  # alike in all directions they may come to what a gain does
        unit /= np.arange(1, len(unit) + 1)
    if "centre" in v.info:
        unit[: len(v.info["radius"])] = np.equal(v.info["radius"], v.info["centre"])
        unit[len(v.info["radius"]) :] = 0.0
    limits, first = Limits.of([v]), np.eye(len(unit))[0]
    apart = np.where(first > 0, 1.0, 0.4 * (-1.0) ** np.arange(len(unit)))  # where a play rests
    ways = [v.root @ u for u in (unit, apart, first)]
    signs = limits.rows[0][limits.floor[0] >= 0]  # how far a curve may go says nothing of its way
    w = next(w for w in ways if np.all(signs @ w >= 0))
    moved = columns[:, list(v.columns)] @ w
    u = moved[: bench.rows.n]
    size = np.sqrt(np.mean((u - u.mean()) ** 2)) or np.sqrt(np.mean(u**2))
    return np.asarray(w * times * bench.noise.stated / size)


@pytest.mark.parametrize(("word", "design"), PAIRS)
def test_own_coefficients_come_back_through_the_fit(word: str, design: str) -> None:
    """What a variant does at 300 times the noise, put on top of the channels, is given back by the
    fit with it: column and derivative are one, through the whole path of weighing and whitening.
    Only the part that springs, gains and datum can't also take is compared."""
    bench, variants, columns = of(word, design)
    base, target = base_columns(bench), bench.observed - prediction(bench)
    for v in variants[:: max(1, len(variants) // 3)]:
        w = strength(bench, v, columns, 300.0)
        scale = float(np.abs(np.linalg.solve(v.root, w)).max())
        explanation = Explanation((Part(v, scale),), 0.0, 0.0, (0.0,), 0.0)
        etas = np.array([0.0, bench.noise.stated])
        with_it = Engine(bench, base, target + columns[:, list(v.columns)] @ w, etas)
        without = Engine(bench, base, target, etas)
        n = bench.rows.n
        change = fit(with_it, explanation).response - fit(without, explanation).response
        np.testing.assert_allclose(
            change, (columns[:, list(v.columns)] @ w)[:n], atol=2 * bench.noise.stated
        )


TIMES = 40.0  # noise: an effect that stands out, so that it must be found
# The forms of these differ by more than their numbers where one pose shows them.
OTHER_NUMBERS = ("base_slip", "base_compliance")


def typical(variants: list[Variant]) -> Variant:
    """One of those that the prior likes best."""
    most = max(v.prior for v in variants)
    best = [v for v in variants if v.prior > 0.99 * most]
    return best[len(best) // 2]


def hidden(found: GapResult) -> bool:
    """What META leaves uncertain explains these data: no effect can be asked for."""
    return found.engine.structural < 1.5 * found.engine.bench.noise.stated


def close(p: Parameter, true: float, slack: float) -> bool:
    """Within the interval, or a share of the truth beside it."""
    return p.low - slack * abs(true) <= true <= p.high + slack * abs(true)


def recovered(word: str, design: str) -> str:
    """Empty if the diagnosis names the word (or says that it can't be told from what it names) and,
    where it stands alone, gives back its parameters; else what is wrong."""
    bench, variants, columns = of(word, design)
    v = typical(variants)
    w = strength(bench, v, columns, TIMES)
    found = explained(with_effect(design, v, columns[:, list(v.columns)] @ w, bench))
    named = {e.name: e for e in found.effects}
    alike = {a for e in found.effects for a in e.indistinguishable_from}
    if word not in named:
        said = word in alike or (hidden(found) and found.verdict == "none")
        return "" if said else f"{v.label}: named {found.verdict} {sorted(named)}"
    if len(named) > 1 or (word in OTHER_NUMBERS and design != "rich"):
        return ""
    # sizes that stand in an exponent or in the measured slope are linear to first order only;
    # another form of the word reads them differently
    slack = 0.1 if named[word].label == v.label else 0.25
    true = parameters(bench, Part(v, 1.0), w, np.zeros((len(w), len(w))))
    return " ".join(
        f"{named[word].label} for {v.label}: {name} {p.value:.4g}, true {true[name].value:.4g}"
        for name, p in named[word].parameters.items()
        if name in true and not close(p, true[name].value, slack)
    )


# The others are found on a bench, or on data of other laws: in recovery/test_gap_effects.py,
# test_pose_beside.py, test_plays.py (backlash), test_several_joints.py (hysteresis) and
# test_as_rigs_are.py (a load askew).
QUICK = (("link_flexibility", "medium"), ("base_compliance", "rich"))


def marks(word: str, design: str) -> tuple[pytest.MarkDecorator, ...]:
    return () if design == "bench" or (word, design) in QUICK else (pytest.mark.slow,)


@pytest.mark.parametrize(
    ("word", "design"), [pytest.param(w, d, marks=marks(w, d)) for w, d in PAIRS]
)
def test_an_effect_finds_itself_or_what_it_cannot_be_told_from(word: str, design: str) -> None:
    assert recovered(word, design) == ""
