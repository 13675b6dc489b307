"""Paths of drifts on absolute clocks, in seconds and kelvin."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.drift import RATES, TEMPERATURE, temperature_of
from identification.gap.laws.law import Law, Term
from identification.gap.model.bench import Bench
from identification.gap.model.history import followed
from identification.gap.model.variants import WARMS_UP, Variant

OF_SESSION = ("drift_knot", "drift_per_kelvin")  # coefficients of paths without a law


def law_of_path(bench: Bench, v: Variant) -> tuple[dict[str, object], tuple[Term, ...], Array]:
    """Constants, k terms and scales (k,) of a path of the library, in seconds and kelvin: what a
    coefficient of the variant is times its scale is the term's coefficient."""
    span, label = bench.load_history.session_span, str(v.info["path"])
    if label == "linear":
        return {"path": "linear"}, (Term("drift_rate"),), np.array([1 / span])
    if label == "root":
        return {"path": "root"}, (Term("drift_per_root"),), np.array([span**-0.5])
    if label.startswith(WARMS_UP):
        share = float(label.removeprefix(WARMS_UP))
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
    sensor, lags = str(v.info["sensor"]), v.info.get("lags_s")
    late = [{}] if lags is None else [{"time_constant": float(t)} for t in lags]
    terms = tuple(Term("drift_per_kelvin", {"sensor": sensor, **how}) for how in late)
    per_kelvin = 1 / float(np.ptp(temperature_of(bench, sensor)))
    return {"path": TEMPERATURE}, terms, np.full(len(terms), per_kelvin)


def path_of(bench: Bench, law: Law, term: Term) -> Array:
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
    read = temperature_of(bench, term.shape["sensor"])
    if "time_constant" in term.shape:
        return followed(read, bench.rows.session, np.array([term.shape["time_constant"]]))[:, 0]
    return np.asarray(read - read[0])


def _twin(one: Term, other: Term) -> bool:
    return one.shape.get("along") == other.shape.get("along")
