"""Every effect of the library, by its file, against what every effect must hold.

Arms and a bench without an arm, force and displacement imposed.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.arrays import Flags
from identification.gap import effects
from identification.gap.data import BRANCH_NAMES, GapData
from identification.gap.effects import EFFECTS
from identification.gap.laws.law import Law
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.model.variants import Variant, place_of
from identification.gap.words import LINEAR, WORDS
from tests.conformance.effect_benches import (
    IN_JOINTS,
    OUTSIDE,
    PAIRS,
    WITHOUT_ARM,
    Array,
    built,
    module,
    of,
    readings,
)
from tests.conformance.gap_designs import (
    ARMS,
    linear,
)

FILES = sorted(p.stem for p in Path(effects.__file__).parent.glob("*.py") if p.stem != "__init__")

# --- form --------------------------------------------------------------------------------------


def test_every_word_has_a_file_and_every_file_a_word() -> None:
    assert sorted(WORDS) == FILES


_BOUNDS = "SCALES|SHARES|OFFSETS_M|ANGLES_RAD|DEPTHS_M|LAGS"


@pytest.mark.parametrize("word", WORDS)
def test_file_states_word_sizes_and_source(word: str) -> None:
    """The word, public bounds as numbers, and in the docstring the size in nature with its unit
    and where it is known from."""
    mod, text = module(word), module(word).__doc__ or ""
    assert word == mod.WORD
    bounds = [v for k, v in vars(mod).items() if re.fullmatch(_BOUNDS, k)]
    assert bounds
    assert all(0 <= x < np.inf for group in bounds for x in group)
    assert re.search(r"Prior: .*\w", text)
    assert re.search(r"Size: .*\d", text)
    assert re.search(r"Source: \w+", text)


# How much of its prior a file says that some of its shapes have, of an arm: from, to.
PRIOR_OF: dict[str, tuple[str, Callable[[Variant], object], float, float]] = {
    "force_drift": ("a quarter to a third of it", lambda v: v.free_pieces, 0.25, 0.34),
    "displacement_scale": ("half of it", lambda v: v.bends, 0.5, 0.5),
    "joint_creep": ("half of it, or a little more", lambda v: len(v.times_s) > 2, 0.5, 0.6),
    "joint_hysteresis": ("two fifths of it", lambda v: "spectrum" in v.label, 0.4, 0.4),
    "joint_nonlinear_stiffness": (
        "half to three quarters of it",
        lambda v: "curve" in v.label,
        0.5,
        0.75,
    ),
    "zero_shift": ("half of it", lambda v: "shifts" in v.info, 0.5, 0.5),
}


def test_priors_are_shared_as_their_files_say() -> None:
    said = {w: " ".join((module(w).__doc__ or "").split()) for w in WORDS}
    assert {w for w, text in said.items() if " of it" in text.split("Prior: ")[1]} == {*PRIOR_OF}
    for word, (says, mine, least, most) in PRIOR_OF.items():
        assert says in said[word]
        for design in ARMS:
            variants = of(word, design)[1]
            share = sum(v.prior for v in variants if mine(v)) / sum(v.prior for v in variants)
            assert least - 1e-9 <= share <= most + 1e-9, (word, design, share)


@pytest.mark.parametrize(("word", "design"), PAIRS)
def test_variants_are_well_formed(word: str, design: str) -> None:
    bench, variants, columns = of(word, design)
    assert variants
    assert np.isfinite(columns).all()
    labels = [v.label for v in variants]
    assert len(set(labels)) == len(labels)
    for v in variants:
        k = len(v.columns)
        assert v.word == word
        assert all(0 <= c < len(bench.columns) for c in v.columns)
        assert v.root.shape == (k, k)
        assert np.linalg.cond(v.root) < 1e6
        assert v.scales
        assert all(0 < s < np.inf for s in v.scales)
        assert 0 < v.prior < np.inf
        assert v.positive is None or (v.positive.shape == (k,) and np.any(v.positive))
        assert np.any(columns[:, list(v.columns)]), v.label


@pytest.mark.parametrize(("word", "design"), [p for p in PAIRS if p[1] in ("medium", "bench")])
def test_shapes_of_one_grid_are_told_by_facts_as_labels_tell_them(word: str, design: str) -> None:
    """Intervals reach to the next shape on the grid: two that differ in more than numbers are no
    neighbours. Labels are for people, and may be reworded: facts must tell as much."""
    by_facts, by_labels = defaultdict(set), defaultdict(set)
    for v in of(word, design)[1]:
        said = re.sub(r"(?<![A-Za-z])\d[\d.e+-]*", "#", v.label), place_of(v)
        by_facts[v.grid].add(said)
        by_labels[said].add(replace(v, label="another").grid)
    assert all(len(same) == 1 for same in (*by_facts.values(), *by_labels.values()))


class _Apart(Pool):
    """A pool in which columns that are alike stand apart."""

    def add(self, column: Array) -> int:
        self._columns.append(column)
        return len(self._columns) - 1


@pytest.mark.parametrize(("word", "design"), PAIRS)
def test_no_variant_takes_a_column_twice(word: str, design: str) -> None:
    """Columns that are alike on these data are one in the pool; of a variant they must be
    different ones, or its prior counts one of them twice."""
    bench = replace(make_bench(linear(design)), columns=_Apart())
    for v in module(word).variants(bench):
        assert len(set(v.columns)) == len(v.columns), v.label


@pytest.mark.parametrize(("word", "design"), PAIRS)
def test_same_data_same_columns(word: str, design: str) -> None:
    _, variants, columns = of(word, design)
    again, others = built(linear(design), word)
    assert np.array_equal(columns, np.column_stack(again.columns))
    assert [(v.label, v.columns, v.scales, v.prior) for v in variants] == [
        (v.label, v.columns, v.scales, v.prior) for v in others
    ]


# --- nothing in, nothing out -------------------------------------------------------------------


FAR, SOON = 1e7, 1e-6  # against loads, lengths and times of the designs
# What a law needs besides its coefficients, and where it is switched off by that.
OFF = {
    "threshold": FAR,
    "strength": FAR,
    "reach": FAR,
    "zone": FAR,
    "beyond": FAR,
    "net_beyond": FAR,
    "net_above": FAR,
    "above": FAR,
    "force_scale": FAR,
    "at_load": FAR,
    "at_response": FAR,
    "retardation_time": FAR,
    "time_constant": FAR,
    "lag": SOON,
}
HELD_BACK = ("Iwan", "Dahl", "Bouc-Wen")  # friction that comes on top of the spring: none is none
# In proportion to their coefficients and to nothing else.
STRAIGHT = ("link_flexibility", "zero_shift", "pose_error", "joint_stiffness_error")


def switched_off(law: Law) -> tuple[Law, Flags]:
    """The law with all its numbers where it does nothing, and (terms,) which of them have one."""
    off = OFF | dict.fromkeys(("strength", "reach"), SOON)
    off = off if law.constants.get("law") in HELD_BACK else OFF

    def nulls(shape: Mapping[str, Any]) -> dict[str, Any]:
        return {key: off.get(key, value) for key, value in shape.items()}

    terms = tuple(replace(t, shape=nulls(t.shape)) for t in law.terms)
    whole = bool(off.keys() & law.constants)
    # of a play its place is a number of its own
    silent = [
        t.coefficient not in ("place", "rest") and (whole or off.keys() & t.shape)
        for t in law.terms
    ]
    return replace(law, constants=nulls(law.constants), terms=terms), np.array(silent, dtype=bool)


@pytest.mark.parametrize("word", [w for w in WORDS if w not in STRAIGHT])
def test_a_law_switched_off_by_its_shape_does_nothing(word: str) -> None:
    """Thresholds that no load reaches, times that nothing waits for, a lag of no time."""
    bench, variants, _ = of(word, "medium")
    laws, kinds = EFFECTS[word].laws, dict[object, Law]()
    for v in variants:
        law, _ = laws.of(bench, v)
        of_kind = [law.constants.get(key) for key in ("law", "kind", "way")]
        terms = [(t.coefficient, *t.shape, t.shape.get("law")) for t in law.terms]
        kinds[(*of_kind, *terms)] = law
    told = 0
    for law in kinds.values():
        off, silent = switched_off(law)
        as_it_is, left = (np.abs(laws.rows(bench, x)[:, silent]) for x in (law, off))
        if silent.any():
            assert left.max() <= 1e-3 * as_it_is.max(), law
            told += 1
    assert told > 0


# These move or show without a load: paths in time, datums, the amplifier, a joint that stands off.
ANYTIME = ("thermal_drift", "zero_shift", "force_drift", "pose_error")


@pytest.mark.parametrize("word", [w for w in WORDS if w not in ANYTIME])
def test_without_a_load_only_drifts_and_shifts_move_the_target(word: str) -> None:
    """What acts through the load, or on readings of it, is silent on an arm that nothing pushes."""
    data = linear("medium")
    still = replace(data, force=np.zeros_like(data.force))
    bench, _ = built(still, word)
    n = bench.rows.n
    for column in bench.columns:
        loose = word == "joint_backlash"  # lies anywhere in its play, by a free place
        assert loose or not np.any(column[:n])


# --- kinds -------------------------------------------------------------------------------------


@cache
def loaded_alike_and_twice_as_far() -> tuple[Bench, Bench, Flags]:
    """Two benches of one straight rig, and the rows on the way down, where the second is loaded
    twice as far: after the same loads on the way up, and on another clock."""
    data = linear("medium")
    down = data.branch == BRANCH_NAMES.index("unloading")

    def pushed(force: Array, session: Array) -> Bench:
        loads = replace(data, force=force, displacement=1.1e-5 * force, session=session)
        return make_bench(loads)

    once = pushed(data.force, data.session)
    twice = pushed(np.where(down, 2.0, 1.0) * data.force, data.session**1.5)
    return once, twice, once.rows.branch == BRANCH_NAMES.index("unloading")


@pytest.mark.parametrize("word", WORDS)
def test_linear_words_are_those_that_follow_the_load_of_the_moment(word: str) -> None:
    """Of a linear word some shape is in proportion to the load, whatever went before and whenever:
    loads superpose. Of the others, which may be less exact than the springs, none is."""
    once, twice, down = loaded_alike_and_twice_as_far()
    laws = EFFECTS[word].laws
    variants = module(word).variants(replace(once, columns=Pool()))

    def superposes(law: Law) -> bool:
        a, b = (laws.rows(bench, law)[: bench.rows.n][down] for bench in (once, twice))
        return bool(np.any(a)) and np.allclose(b, 2 * a, rtol=0, atol=1e-6 * np.abs(a).max())

    some = [laws.of(once, v)[0] for v in variants[:: 1 + len(variants) // 20]]
    assert any(map(superposes, some)) == (word in LINEAR)


# --- joints and readings -----------------------------------------------------------------------


@pytest.mark.parametrize("word", IN_JOINTS)
@pytest.mark.parametrize("design", ["rich", "medium"])
def test_joint_effects_show_in_their_own_joint_alone(word: str, design: str) -> None:
    """The reading moves by the deflection, the laser by its lever times it."""
    bench, variants, columns = of(word, design)
    edges = np.flatnonzero(bench.rows.hold_starts)
    for v in variants:
        joints = v.info.get("joints", [v.info.get("joint")])
        for c in v.columns:
            if not np.any(columns[:, c]):
                continue  # a form that this path never reaches
            q = readings(bench, columns[:, [c]])[:, :, 0]
            moved = np.flatnonzero(np.any(q != 0, axis=1))
            assert len(moved) == 1, v.label
            assert moved[0] in joints, v.label
            u = columns[: bench.rows.n, c]
            if word == "joint_backlash" and not u.any():
                continue  # where in its play the joint is when its reading is as commanded
            weight = bench.rows.weight
            mean = np.add.reduceat(u * weight, edges) / np.add.reduceat(weight, edges)
            np.testing.assert_allclose(
                mean, bench.lever[edges, moved[0]] * q[moved[0]], rtol=1e-9, atol=1e-15
            )


@pytest.mark.parametrize("word", OUTSIDE)
@pytest.mark.parametrize("design", ["rich", "medium"])
def test_what_lies_outside_the_joints_leaves_their_readings(word: str, design: str) -> None:
    bench, _, columns = of(word, design)
    assert not np.any(columns[bench.layout.q.start :])


@pytest.mark.parametrize("word", [w for w in WORDS if w in OUTSIDE or w in IN_JOINTS])
def test_imposed_displacement_is_kept_whoever_gives_way(word: str) -> None:
    """Laser imposed: motions of all joints and of what lies outside cancel; force pays."""
    bench, _, columns = of(word, "arm imposed")
    edges, n = np.flatnonzero(bench.rows.hold_starts), bench.rows.n
    columns = columns[:, np.any(columns[:n] != 0, axis=0)]  # not what only a reading is off
    weight = bench.rows.weight
    u = columns[:n] * weight[:, None]
    response = np.add.reduceat(u, edges) / np.add.reduceat(weight, edges)[:, None]
    q = readings(bench, columns)
    moved = np.einsum("hj,jhk->hk", bench.lever[edges], q)
    if word in IN_JOINTS:
        np.testing.assert_allclose(moved, 0.0, atol=1e-9 * np.abs(columns).max())
    else:  # the joints give back what force no longer bends
        np.testing.assert_allclose(moved, response, rtol=1e-9, atol=1e-12 * np.abs(columns).max())


# --- units -------------------------------------------------------------------------------------

IN_NM = ("base_compliance", "base_slip")  # priors in rad/Nm: the units of nature, not of the data


def more_newtons(data: GapData, a: float) -> GapData:
    """The same rig with forces in another unit: all that holds newtons goes along."""
    meter = replace(data.instruments, force=data.instruments.force * a)
    setups = tuple(
        replace(s, links=s.links / a, gravity=s.gravity * a, tool_gravity=s.tool_gravity * a)
        for s in data.setups
    )
    return replace(
        data,
        force=data.force * a,
        compliance=data.compliance / a,
        instruments=meter,
        setups=setups,
        tangential=None if data.tangential is None else data.tangential * a,
    )


def prior_columns(columns: Array, v: Variant) -> Array:
    """What one standard deviation of its prior does to the channels: of the first size."""
    return np.asarray(columns[:, list(v.columns)] @ v.root * v.scales[0])


@pytest.mark.parametrize(("word", "design"), PAIRS)
def test_another_unit_of_force_changes_nothing_but_units(word: str, design: str) -> None:
    """Prior columns (scale x column) stay in metres and radians, and grow as newtons do."""
    a = 64.0  # exact in binary
    bench, variants, columns = of(word, design)
    other, others = built(more_newtons(linear(design), a), word)
    scaled = np.column_stack(other.columns)
    assert [v.label for v in variants] == [v.label for v in others]
    grows = a if word in IN_NM else 1.0
    force = np.ones(bench.layout.size)
    force[bench.layout.q.stop :] = a
    for v, w in list(zip(variants, others, strict=True))[:: max(1, len(variants) // 60)]:
        assert v.columns == w.columns
        expected = prior_columns(columns, v) * force[:, None] * grows
        np.testing.assert_allclose(
            prior_columns(scaled, w),
            expected,
            rtol=1e-9,
            atol=1e-12 * (np.abs(expected).max() or 1.0),
        )


@pytest.mark.parametrize(("word", "design"), WITHOUT_ARM)
def test_another_unit_of_length_changes_nothing_but_units(word: str, design: str) -> None:
    """A bench has no absolute length: prior columns grow with the unit."""
    b, data = 1 / 128.0, linear(design)
    meter = replace(data.instruments, displacement=data.instruments.displacement * b)
    small = replace(
        data, displacement=data.displacement * b, compliance=data.compliance * b, instruments=meter
    )
    bench, variants, columns = of(word, design)
    other, others = built(small, word)
    length = np.ones(bench.layout.size)
    length[: bench.rows.n] = b
    for v, w in zip(variants, others, strict=True):
        expected = prior_columns(columns, v) * length[:, None]
        np.testing.assert_allclose(
            prior_columns(np.column_stack(other.columns), w),
            expected,
            rtol=1e-9,
            atol=1e-12 * (np.abs(expected).max() or 1.0),
        )
