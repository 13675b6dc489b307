"""Displacement moves with time or temperature, not with the load; encoders do not see it.

A path on the session clock, one coefficient per direction (the drift is a vector): warm-up with one
time constant, a line, a free smooth path, or the recorded temperatures, which masses of several
kilograms follow late. 10 to 400 um over hours.

Size: 10 to 400 um over hours; 0.3 to 30 % of the deflection.
Prior: either sign per direction, sd out of SHARES, equally likely; as much on all that follows a
temperature late as on what follows it at once.
Source: warm-up of arms with a lag, 1 um/K of laser sensors.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.drift import (
    MEAN,
    TEMPERATURE,
    by_direction,
    changes,
    free_path,
    free_paths,
    free_variant,
    paths,
    rates,
    shares,
    temperature_of,
)
from identification.gap.laws.drift_law import OF_SESSION, law_of_path, path_of
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term, along
from identification.gap.model.bench import Bench
from identification.gap.model.history import followed
from identification.gap.model.variants import Variant, variant

WORD = "thermal_drift"
SHARES = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the deflection
LAGS = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the session
_SEEN = 2  # rows within a lag


def variants(bench: Bench) -> list[Variant]:
    """Paths times directions."""
    named, masks = zip(*by_direction(bench).items(), strict=True)
    out = []
    for label, path in paths(bench).items():
        columns = [bench.add(bench.outside_column(m * path)) for m in masks]
        out.append(
            variant(WORD, label, columns, _scales(bench), positive=False, path=label, names=named)
        )
    for sensor, path in _temperatures(bench).items():
        columns = [bench.add(bench.outside_column(m * path)) for m in masks]
        out.append(
            variant(
                WORD,
                _called(sensor),
                columns,
                _scales(bench, path),
                positive=False,
                path=TEMPERATURE,
                names=named,
                sensor=sensor,
            )
        )
    out += _late(bench)
    scales, free = _scales(bench), free_paths(bench)
    if not free:
        return out
    every = [bench.add(bench.outside_column(m * path)) for m in masks for path in rates(bench)]
    out.append(
        variant(WORD, "rates", every, scales, positive=False, prior=2.0, path="rates", names=named)
    )
    for label, way in free.items():
        hats = free_path(bench, way.pieces)
        columns = [bench.add(bench.outside_column(m * hat)) for m in masks for hat in hats.T]
        out.append(free_variant(WORD, label, way, columns, scales, named))
    return out


def _temperatures(bench: Bench) -> dict[str, Array]:
    """Sensor -> (n,) rise of what it read, in shares of its range; their mean, and each."""
    t = bench.rows.temperature
    if t is None:
        return {}
    sensors = [MEAN, *(str(j + 1) for j in range(t.shape[1]))]
    read = {s: temperature_of(bench, s) for s in sensors}
    return {s: (v - v[0]) / np.ptp(v) for s, v in read.items() if np.ptp(v) > 0}


def _called(sensor: str) -> str:
    return "mean temperature" if sensor == MEAN else f"temperature {sensor}"


def _scales(bench: Bench, path: Array | None = None) -> tuple[float, ...]:
    """m, of a path; of a recorded temperature (n,) by how that went."""
    return tuple(s * bench.reach for s in shares(bench, SHARES, path))


def _late(bench: Bench) -> list[Variant]:
    """What warms up after the temperature that is recorded, in lags that are neighbours, which
    makes all lags between them."""
    lags, out = _lags(bench), []
    named, masks = zip(*by_direction(bench).items(), strict=True)
    for sensor, path in _temperatures(bench).items():
        ways = followed(path, bench.rows.session, lags)
        for k in range(len(lags) - 1):
            columns = [
                bench.add(bench.outside_column(m * way))
                for m in masks
                for way in ways[:, k : k + 2].T
            ]
            out.append(
                variant(
                    WORD,
                    f"{_called(sensor)} late {lags[k]:.3g} s",
                    columns,
                    _scales(bench, path),
                    positive=False,
                    prior=1 / (len(lags) - 1),
                    path=TEMPERATURE,
                    names=named,
                    sensor=sensor,
                    lags_s=lags[k : k + 2],
                )
            )
    return out


def _lags(bench: Bench) -> Array:
    """(k,) s: of the session, as far as a few rows tell of one."""
    lags = np.array(LAGS) * bench.load_history.session_span
    return lags[lags > _SEEN * bench.load_history.session_span / bench.rows.n]


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    return changes(bench, v, found, "mm", 1e3)


def _describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms of the path for every direction."""
    constants, terms, scale = law_of_path(bench, v)
    every: list[Term] = []
    vectors = {s.direction: s.unit_vector for s in reversed(bench.data.setups)}
    names = list(dict.fromkeys(s.direction for s in bench.data.setups))
    for name in names:
        n = tuple(float(x) for x in vectors[name])
        every += [Term(t.coefficient, {**t.shape, "along": n}) for t in terms]
    law = Law(constants | {"quantity": "displacement"}, tuple(every))
    return law, np.tile(scale, len(names))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Along the term's direction; against it, the other way round."""
    return [
        bench.outside_column(along(bench, t.shape["along"]) * path_of(bench, law, t))
        for t in law.terms
    ]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns, of_session=OF_SESSION, lasts=False),
    lengths=("drift_over_session",),
    finer=None,
)
