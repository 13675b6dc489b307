"""The pool of columns, arrays that grow, and variants that are one shape under several names."""

from __future__ import annotations

from dataclasses import replace
from gc import collect
from weakref import ref

import numpy as np
import pytest

from identification.gap.answer.discriminate import _BESIDES, _HALF, ENOUGH, Option, _settled
from identification.gap.diagnose import diagnose_gap
from identification.gap.effects import library
from identification.gap.evidence import compare
from identification.gap.evidence.compare import score
from identification.gap.evidence.table import EvidenceTable
from identification.gap.model.bench import make_bench
from identification.gap.model.growing import Growing
from identification.gap.model.pool import Pool
from tests.unit.test_gap_evidence import small_bench, small_engine
from tests.unit.test_gap_forms import arm_data


def test_a_column_is_in_the_pool_once() -> None:
    pool, column = Pool(), np.array([1.0, -2.0, 1 / 3])
    first = pool.add(column)
    assert pool.add(column * (1 + 1e-15)) == first  # another order of the same sums
    assert pool.add(np.zeros(3)) == pool.add(-np.zeros(3))
    others = [pool.add(c) for c in (-column, 2 * column, column + 1e-6, np.zeros(3))]
    assert len({first, *others}) == len(pool) == 5
    assert pool[first] is column
    assert next(iter(pool)) is column


def test_what_grows_holds_all_rows_and_leaves_what_was_there() -> None:
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(k, 3)) for k in (0, 4, 1, 1, 7, 2)]
    grown, before = Growing(parts[0]), []
    for part in parts[1:]:
        before.append(grown.values.copy())
        was = grown.values
        grown.put([part[:1], part[1:]])
        assert np.array_equal(was, before[-1])
    assert np.array_equal(grown.values, np.vstack(parts))


def test_one_shape_under_several_names_is_scored_once(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = small_bench()
    shapes = library(bench, ["joint_creep", "joint_stiffness_error"])
    twins = [replace(v, label=f"{v.label} again", prior=0.1 * v.prior) for v in shapes]
    other = replace(shapes[0], root=2 * shapes[0].root)
    engine, looked = small_engine(bench), []

    class Counted(EvidenceTable):
        def limit(self) -> None:
            looked.append(len(self._columns))
            super().limit()

    plain = score(engine, engine.levels, shapes)
    monkeypatch.setattr(compare, "EvidenceTable", Counted)
    engine.stacks.clear()
    both = score(engine, engine.levels, [*shapes, *twins, other])
    assert [s.variant for s in both] == [*shapes, *twins, other]
    for one, again, known in zip(both, both[len(shapes) :], plain, strict=False):
        assert one.log_evidence == pytest.approx(known.log_evidence, rel=1e-9)
        assert again.log_evidence == pytest.approx(known.log_evidence + np.log(0.1), rel=1e-9)
        assert (again.scale, again.level) == (known.scale, known.level)
    assert both[-1].log_evidence != pytest.approx(plain[0].log_evidence, abs=1e-3)
    assert sum(looked) == len({v.shape for v in shapes}) + 1


def test_a_slip_at_another_depth_is_the_same_shape_where_moments_run_in_proportion() -> None:
    """One pose: a direction turns the base about an axis at any depth by a lever of its own."""
    data = arm_data()
    bench = make_bench(replace(data, setups=data.setups[:2] * 2))
    slips = library(bench, ["base_slip"])
    depths: dict[object, dict[object, set[float]]] = {}
    for v in slips:
        key = v.info["axis"], v.info["memory"], v.label.split(" at ")[-1]
        depths.setdefault(key, {}).setdefault(v.shape, set()).add(v.info["depth_m"])
    assert depths
    assert max(map(len, depths.values())) == 1  # one shape
    alike = {len(d) for shapes in depths.values() for d in shapes.values()}
    assert alike == {1, 2, 3}  # yaw; tilts; tilts and a slide
    natural = {v.info["depth_m"]: v.info["natural"] for v in slips if v.info["axis"] == "x"}
    assert natural[0.7] < natural[0.0]  # a longer lever does more


def test_procedures_that_take_too_long_to_be_worth_more_are_left_out() -> None:
    quick = Option("steps", "", 1000 * _HALF, 10.0)
    some = [Option(f"{i}", "", ENOUGH + 1, 20.0) for i in range(_BESIDES)]
    assert _settled([quick, *some], 10.5)
    assert not _settled([quick, *some], 9.5)  # would be worth more, if it decides
    assert not _settled([quick, *some[1:]], 1000.0)  # too few to choose from
    poor = [Option(f"{i}", "", ENOUGH - 1, 20.0) for i in range(9)]
    assert not _settled([quick, *poor], 1000.0)


@pytest.mark.slow
def test_nothing_keeps_a_diagnosis_alive() -> None:
    """A campaign makes hundreds of them in one process, of a hundred megabytes each."""
    found = diagnose_gap(arm_data())
    bench = ref(found.bench)
    del found
    collect()
    assert bench() is None


def test_a_shape_is_all_that_evidence_follows_from() -> None:
    one = library(small_bench(), ["joint_creep"])[0]
    others = [
        replace(one, least=0.5),
        replace(one, scales=(9.0,)),
        replace(one, positive=None),
        replace(one, info={**one.info, "other_springs": True}),
        replace(one, within=np.ones((1, len(one.columns)))),
        replace(one, each=tuple(not e for e in one.each)),
    ]
    assert len({one.shape, *(v.shape for v in others)}) == 1 + len(others)
    assert replace(one, label="again", prior=0.1).shape == one.shape
