"""Gains, lags, drifts and shifts: what the instruments do, on absolute clocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects import force_drift, force_scale, time_lag
from identification.gap.effects.curves import hinge
from identification.gap.effects.drift import RATES
from identification.gap.forms.law import Law, Term, along
from identification.gap.variants import Variant


def describe_gain(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: the share of what is shown that is too much, `1 - 1 / gain`; where it bends, that
    which comes on top in proportion to the reading, or to what of it lies above a range."""
    if "component" in v.info:
        return Law({}, (Term("gain", {"axis": str(v.info["component"])}),)), np.ones(1)
    if len(v.columns) == 1:
        return Law({}, (Term("gain"),)), np.ones(1)
    if "above" in v.info:
        return Law({}, (Term("gain"), Term("gain", {"above": float(v.info["above"])}))), np.ones(2)
    of = "at_load" if v.word == "force_scale" else "at_response"
    return Law({}, (Term("gain"), Term("gain", {of: float(v.info["full"])}))), np.ones(2)


def force_gain(bench: Bench, law: Law) -> list[Array]:
    """Less force than read deflects less."""
    return [
        force_scale.component(bench, "xyz".index(t.shape["axis"]))
        if "axis" in t.shape
        else force_scale.shown(bench, _bent(bench.load, t, "at_load"))
        for t in law.terms
    ]


def displacement_gain(bench: Bench, law: Law) -> list[Array]:
    """A share of the response to the load."""
    return [bench.outside_column(_bent(bench.line, t, "at_response")) for t in law.terms]


def _bent(read: Array, term: Term, of: str) -> Array:
    if "above" in term.shape:
        return hinge(read, term.shape["above"])
    return read * np.abs(read) / term.shape[of] if of in term.shape else read


def describe_lag(_: Bench, v: Variant) -> tuple[Law, Array]:
    """One term: 1 where the lag is as long as stated; of a window half delay, half filter."""
    constants = {
        "channel": str(v.info["channel"]),
        "way": str(v.info["kind"]),
        "lag": float(v.info["lag_s"]),
    }
    terms = (Term("share"),) * len(v.columns)
    return Law(constants, terms), np.ones(len(terms))


def lag(bench: Bench, law: Law) -> list[Array]:
    """The channel shows where the load was a little earlier."""
    c = law.constants
    kinds = ("delay", "filter") if c["way"] == "window" else (c["way"],)
    return [time_lag.late(bench, c["channel"], kind, c["lag"]) for kind in kinds]


def describe_force_drift(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms of the path."""
    if v.info["path"] == "each run":
        each_run = tuple(
            Term("drift", {"run": r, "along": force_drift.AXES[name]})
            for r, name in v.info["places"]
        )
        return Law({"path": "each run", "quantity": "force"}, each_run), np.ones(len(each_run))
    constants, terms, scale = _path(bench, v)
    law = constants | {"quantity": "force"}
    if v.info["names"] == ("",):
        along = {k: v.info[k] for k in ("along",) if k in v.info}
        return Law(law, tuple(replace(t, shape={**t.shape, **along}) for t in terms)), scale
    named = tuple(
        replace(t, shape={**t.shape, "along": force_drift.AXES[name]})
        for name in v.info["names"]
        for t in terms
    )
    return Law(law, named), np.tile(scale, len(v.info["names"]))


def describe_thermal(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms of the path for every direction."""
    constants, terms, scale = _path(bench, v)
    every: list[Term] = []
    vectors = {s.direction: s.unit_vector for s in reversed(bench.data.setups)}
    names = list(dict.fromkeys(s.direction for s in bench.data.setups))
    for name in names:
        n = tuple(float(x) for x in vectors[name])
        every += [Term(t.coefficient, {**t.shape, "along": n}) for t in terms]
    law = Law(constants | {"quantity": "displacement"}, tuple(every))
    return law, np.tile(scale, len(names))


def drift_of_force(bench: Bench, law: Law) -> list[Array]:
    """Measured = true + d(t), less what was tared away; zero plateaus show d itself."""
    out = []
    for t in law.terms:
        if "run" in t.shape:
            path = force_drift.since(bench, t.shape["run"])
            out.append(force_drift.component(bench, t.shape["along"], path))
            continue
        if "along" in t.shape:
            out.append(force_drift.component(bench, t.shape["along"], _moved(bench, law, t)))
            continue
        d = force_drift._tared(bench, _moved(bench, law, t))
        out.append(force_drift.drifting(bench, d))
    return out


def drift_of_displacement(bench: Bench, law: Law) -> list[Array]:
    """Along the term's direction; against it, the other way round."""
    return [
        bench.outside_column(along(bench, t.shape["along"]) * _moved(bench, law, t))
        for t in law.terms
    ]


def _path(bench: Bench, v: Variant) -> tuple[dict[str, object], tuple[Term, ...], Array]:
    """Constants, terms and scales of a path of the library, in seconds and kelvin."""
    span, label = bench.course.session_span, str(v.info["path"])
    if label == "linear":
        return {"path": "linear"}, (Term("drift_rate"),), np.array([1 / span])
    if label == "root":
        return {"path": "root"}, (Term("drift_per_root"),), np.array([span**-0.5])
    if label.startswith("T "):
        share = float(label[2:])
        rise = 1 / (1 - np.exp(-1 / share))
        term = Term("drift", {"time_constant": share * span})
        return {"path": "exponential"}, (term,), np.array([rise])
    if label == "rates":
        rises = [1 / (1 - np.exp(-1 / r)) for r in RATES]
        terms = (Term("drift_rate"), *(Term("drift", {"time_constant": r * span}) for r in RATES))
        return {"path": "rates"}, terms, np.array([1 / span, *rises])
    if label == "free":
        places = np.linspace(0, span, int(v.info["pieces"]))
        terms = tuple(Term("drift_knot", {"at": float(t)}) for t in places)
        return {"path": "free"}, terms, np.ones(len(terms))
    values = bench.rows.temperature
    assert values is not None
    sensor = "mean" if label.startswith("mean") else label.rsplit(maxsplit=1)[-1]
    read = values.mean(axis=1) if sensor == "mean" else values[:, int(sensor) - 1]
    term = Term("drift_per_kelvin", {"sensor": sensor})
    return {"path": "temperature"}, (term,), np.array([1 / float(np.ptp(read))])


def _moved(bench: Bench, law: Law, term: Term) -> Array:
    """(n,): the path per unit of the coefficient, 0 at the start of the session."""
    t = bench.rows.session - bench.rows.session.min()
    path = law.constants["path"]
    if path == "linear" or term.coefficient == "drift_rate":
        return np.asarray(t)
    if path == "root":
        return np.asarray(np.sqrt(t))
    if path in ("exponential", "rates"):
        return np.asarray(1 - np.exp(-t / term.shape["time_constant"]))
    if path == "free":
        places = sorted({x.shape["at"] for x in law.terms if _twin(x, term)})
        hat = np.equal(places, term.shape["at"]).astype(float)
        return np.asarray(np.interp(t, places, hat))
    values = bench.rows.temperature
    if values is None:
        return np.zeros(bench.rows.n)
    sensor = term.shape["sensor"]
    v = values.mean(axis=1) if sensor == "mean" else values[:, int(sensor) - 1]
    return np.asarray(v - v[0])


def _twin(one: Term, other: Term) -> bool:
    return one.shape.get("along") == other.shape.get("along")


def describe_shift(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: one lasting jump before a run, or the offsets of whole runs (numbers from 0)."""
    if v.info["runs"]:
        terms = tuple(Term("shift", {"run": int(r), "lasts": True}) for r in v.info["runs"])
    else:
        terms = tuple(Term("shift", {"run": int(r), "lasts": False}) for r in v.info["shifts"])
    return Law({}, terms), np.ones(len(terms))


def shift(bench: Bench, law: Law) -> list[Array]:
    """The runs of that setup, from the jump on or that one alone."""
    rows, out = bench.rows, []
    for t in law.terms:
        r = t.shape["run"]
        mine = np.zeros(rows.n)
        if np.any(rows.run == r):
            setup = rows.setup[int(np.argmax(rows.run == r))]
            mine = np.where((rows.setup == setup) & (rows.run >= r), 1.0, 0.0)
            mine = mine if t.shape["lasts"] else np.where(rows.run == r, 1.0, 0.0)
        out.append(bench.outside_column(mine))
    return out
