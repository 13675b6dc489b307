"""Deflection that grows while the load is held (or force that relaxes), and recovers after it.

Kelvin-Voigt elements behind a joint's spring: `T z' = tau - z`; any linear creep compliance is a
spectrum of retardation times (Prony series, power and log laws included; Findley 1976), the last
of them so long that it flows and does not come back (Burgers 1935). Large stresses creep more than
in proportion: the same of the squared torque. The coefficients are compliances in units of the
joint's own, of what flows over one run: polymers, grease and gears 1 to 50 %.

What crept goes back between two runs, as the session's clock tells, or, without one, for minutes
or less; or nothing is left of it where
the rig is turned to another direction, which may take hours that no clock counts.

Size: 1 to 50 % of the elastic deflection: polymers, grease, gears.
Prior: shares positive in sum, sd out of SCALES, equally likely; half of it, or a little
more, on whole spectra.
Source: Findley 1976.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.evidence.compare import closest
from identification.gap.evidence.parts import Part
from identification.gap.laws.closer import RefinementTarget, closing_in, estimates, places, shows
from identification.gap.laws.curves import BENT_SLOPE
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter, factors
from identification.gap.laws.law import ANEW, Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.history import retarded, unread_ramp_duration
from identification.gap.model.variants import RESET_PER_SETUP, Variant, smooth_root, variant

WORD = "joint_creep"
SCALES = (0.02, 0.06, 0.2, 0.6)
_OF_A_STROKE = 0.05  # what follows as closely at one rate is no slower than friction
VISCOUS = 10.0  # times the session: what gives way as slowly flows, and does not come back
_LONGEST = 1000.0  # samples, or seconds where samples are more frequent


def times(bench: Bench) -> np.ndarray:
    """(k,) retardation times s, by factors of three. From one sample to a third of the session, of
    which no more than a thousand samples tell; of an arm one more that flows. Of a recording that
    runs on, or of a rig without an arm, to three times its length: a viscous flow looks like a line
    then."""
    step = bench.rows.row_time or 1.0
    longest = min(bench.load_history.session_span / 3, _LONGEST * max(step, 1.0))
    if not (bench.data.arm or bench.rows.continuous):
        step = bench.rows.sample_time  # of rows there are the fewer, the longer it stood
    if not (bench.data.arm or bench.load_history.always_moves):
        longest = 3 * bench.load_history.session_span
    first = max(step * 3 if bench.load_history.always_moves else step, 1e-6)
    if bench.load_history.one_rate and bench.load_history.returns:
        first = max(first, _OF_A_STROKE * bench.load_history.stroke_s)
    count = max(2, int(np.ceil(np.log(max(longest / first, 3.0)) / np.log(3))))
    out = np.asarray(first * 3.0 ** np.arange(count))
    return np.append(out, VISCOUS * bench.load_history.session_span) if bench.data.arm else out


def in_a_run(bench: Bench, times_s: Array) -> Array:
    """(k,) in how many units of its coefficient an element of a time (k,) s ends: what flows counts
    by what it does under a load that stands for one run, however many runs there are."""
    flows = times_s >= VISCOUS * bench.load_history.session_span
    return np.where(flows, times_s / max(run_seconds(bench), bench.rows.row_time, 1e-6), 1.0)


def scales(bench: Bench) -> tuple[float, ...]:
    """Of the simulated spring's compliance. Tissue, gels and melts on rigs without an arm go on to
    whatever was seen, thousands of times what the spring gives at once."""
    given = bench.slope * bench.load  # a load that stands came from zero before anybody looked
    simulated = float(np.ptp(np.append(given, 0.0) if bench.load_history.rests else given))
    if bench.data.arm or not simulated > 0:
        return SCALES
    seen = bench.reach / simulated
    return (*SCALES, *(s for s in (2.0, seen, 4 * seen) if s > 1.5))


def variants(bench: Bench) -> list[Variant]:
    """Per joint: single times with their neighbour, and the whole spectrum; none of one pull that
    never stood: how fast it went and how far are one thing there, and a curve is simpler."""
    if bench.load_history.never_held or bench.load_history.timeless:
        return []
    times_s, sizes, other = times(bench), scales(bench), _other_rests(bench)
    out: list[Variant] = []
    for j in bench.moving_joints():
        for memory, fresh in _memories(bench).items():
            info = {"joint": j, "memory": memory.strip(), "bent": False}
            name, likely = f"joint {j + 1}{memory}", _LIKELY[memory]
            columns = _elements(bench, j, times_s, fresh)
            found = _Elements(name, columns, times_s, sizes, info)
            whole = 0.5 * likely / (1 + len(other))
            out.append(found.spectrum(whole))
            out += found.pairs((0.3 if bench.data.arm else 0.5) * likely)
            for rested in other:
                columns = _elements(bench, j, times_s, fresh, rested=rested)
                called, told = f"{name} after rests of {rested:g} s", {**info, "rested": rested}
                out.append(_Elements(called, columns, times_s, sizes, told).spectrum(whole))
        if bench.data.arm or not bench.load_history.one_rate:  # else a loop of any shape
            info = {"joint": j, "memory": "", "bent": True}
            columns = _elements(bench, j, times_s, None, is_bent=True)
            found = _Elements(f"joint {j + 1}{BENT}", columns, times_s, sizes, info)
            out += [found.spectrum(0.2), *found.pairs(0.2)]
    return out


_LIKELY = {"": 1.0, RESET_PER_SETUP: 0.5}


def _memories(bench: Bench) -> dict[str, Flags | None]:
    """When nothing is left of what crept before: never, or when the rig is set up anew."""
    out: dict[str, Flags | None] = {"": None}
    if np.sum(bench.rebuilt) > 1:
        out[RESET_PER_SETUP] = bench.rebuilt
    return out


def _elements(
    bench: Bench,
    joint: int,
    times_s: Array,
    fresh: Flags | None,
    *,
    is_bent: bool = False,
    stood: float = 0.0,
    rested: float | None = None,
) -> list[int]:
    """Column of an element of every time (k,). stood, rested: as in `phases_of`."""
    load = np.tile(bench.true_torque[:, joint][:, None], (1, len(times_s)))
    load = signed_squares(load) if is_bent else load
    z = retarded(load, times_s, bench.rows, bench.rest, fresh, stood, rested)
    unit = bench.sense * bench.compliance[joint] * in_a_run(bench, times_s)
    return [bench.add_joint(joint, y) for y in (unit * z).T]


class _Elements(NamedTuple):
    """columns: indices of the pool, one for every time (k,) s; name, sizes (scales) and facts of
    the shapes that are made of them."""

    name: str
    columns: list[int]
    times_s: Array
    sizes: tuple[float, ...]
    info: dict[str, Any]

    def spectrum(self, prior: float) -> Variant:
        """All times, neighbours alike."""
        return variant(
            WORD,
            f"{self.name} spectrum",
            self.columns,
            self.sizes,
            root=smooth_root(len(self.columns), 0.5),
            prior=prior,
            each=True,
            form="spectrum",
            times_s=self.times_s,
            **self.info,
        )

    def pairs(self, prior: float) -> list[Variant]:
        """Each time with its neighbour; the prior is that of them all."""
        return [
            variant(
                WORD,
                f"{self.name} T {self.times_s[k]:.3g} s",
                self.columns[k : k + 2],
                self.sizes,
                prior=prior / (len(self.columns) - 1),
                each=True,
                times_s=self.times_s[k : k + 2],
                **self.info,
            )
            for k in range(len(self.columns) - 1)
        ]


def refined(bench: Bench, found: Variant, _: float = 1.0) -> list[Variant]:
    """Pairs of times that lie closer together, about a pair that was found. One time between two of
    the grid is met by these to one or two percent of what creeps, which a good laser sees."""
    low, high = found.times_s
    between = np.log(min(high / low, _SEEN_TO)) / np.log(STEP)
    times_s = low * STEP ** np.arange(-1, round(between) + 2)
    joint, memory = int(found.info["joint"]), str(found.info["memory"])
    is_bent, fresh = bool(found.info["bent"]), bench.rebuilt if memory else None
    rests = list(_rests(bench))
    prior, out = _FINE_PRIOR * found.prior / len(rests), list[Variant]()
    for stood, rested in rests:
        name = f"joint {joint + 1}{' ' * bool(memory)}{memory}{BENT * is_bent} fine"
        name += f" stood on for {stood:g} of the rest" * (stood > 0)
        name += "" if rested is None else f" of {rested:g} s"
        info = {"joint": joint, "memory": memory, "bent": is_bent, "stood": stood, "rested": rested}
        columns = _elements(
            bench, joint, times_s, fresh, is_bent=is_bent, stood=stood, rested=rested
        )
        out += _Elements(name, columns, times_s, found.scales, info).pairs(prior)
    return out


def _rests(bench: Bench) -> Iterator[tuple[float, float | None]]:
    """What may have been in the rests between runs: for which share of it the load stood on, where
    no row shows when it was taken off; and how long it took (s)."""
    for stood in STOOD if _unloads_unseen(bench) else STOOD[:1]:
        yield stood, None
        yield from ((stood, rested) for rested in _other_rests(bench))


def _other_rests(bench: Bench) -> tuple[float, ...]:
    """s that rests between runs may have taken, beside the minutes that are taken for them, where
    no clock of the session was recorded."""
    rows = bench.rows
    unknown = not rows.clock and not rows.continuous and bool(np.any(bench.rest[1:]))
    return RESTS_S if unknown else ()


def _unloads_unseen(bench: Bench) -> bool:
    """Whether loads were taken off between two runs: when, no row says."""
    rests = np.flatnonzero(bench.rest[1:]) + 1
    return bool(np.any(np.abs(bench.load[rests - 1]) > _LOADED * np.abs(bench.load).max()))


_LOADED = 0.2  # of the largest load, from which a last reading is no longer one without
STOOD_ON = "share_of_rest_stood_on"  # in the constants of a law
STOOD = (0.0, 0.5, 1.0)  # shares of such a rest for which the load stood on
RESTED = "rest_between_runs"  # s, in the constants of a law
RESTS_S = (20.0, 60.0)  # beside the minutes that are taken for them
STEP = 3.0**0.25  # from time to time of a closer look
_SEEN_TO = 9.0  # times the last time that ends, up to where flowing is one with it
_FINE_PRIOR = 1.5  # of them all, over that of the pair, of which they reach over one and a half


def _look_closer(word: RefinementTarget) -> list[Variant]:
    """About the best pairs, at every joint that they may sit in: where joints look alike, that one
    was looked at more closely is no evidence."""
    if not shows(word):
        return []
    best = places(word.alone, word.beside, lambda v: len(v.times_s) == 2, most=6)
    first = closest(word.families[word.ranked[0]])
    beside = () if first.variant.word == WORD else (Part(first.variant, first.scale),)
    closer = closing_in(word, refined, best)
    found = estimates(word.engine, closer, beside)
    return [v for v, e in zip(closer, found, strict=True) if _grows(e.coefficients)]


def _grows(coefficients: Array) -> bool:
    """Whether elements (k,) only creep. Of two times as close to each other as here one may go back
    nearly as much as the other creeps, and both together do what no spectrum does."""
    return bool(coefficients.min() > -_BACK * coefficients.max())


_BACK = 0.05


BENT = " more than in proportion"


def signed_squares(load: Array) -> Array:
    """Loads (n, k) by their squares, with their signs, alike at the largest."""
    return np.asarray(load * np.abs(load) / (float(np.abs(load).max()) or 1.0))


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    times, seconds = np.asarray(v.info["times_s"]), run_seconds(bench)
    whole = in_a_run(bench, times)
    power = np.maximum(found.w, 0.0)
    mean = (
        float(np.exp(power @ np.log(times) / power.sum())) if power.sum() > 0 else float(times[0])
    )
    joint = v.info.get("joint")
    line = BENT_SLOPE if v.info.get("bent") else 1.0
    found = _with_arrival_uncertainty(bench, found, times)
    return {
        "creep_fraction": found.per_spring(np.full(len(times), line), joint),
        "creep_fraction_of_run": found.per_spring(
            -line * whole * np.expm1(-seconds / times), joint
        ),
        "run": Parameter(seconds, seconds, seconds, "s"),
        "retardation_time": factors(mean, 3.0, "s"),
    }


def _with_arrival_uncertainty(bench: Bench, found: Coefficients, times: Array) -> Coefficients:
    """Coefficients as uncertain as the moment at which a load came to its level, which no reading
    shows: anywhere on its way there (a rectangular distribution, GUM 4.3.7). What had crept before
    the first reading, `dt / T` of it, is taken for the spring's."""
    way = unread_ramp_duration(bench.rows) or 0.0
    early = np.minimum(way / 12**0.5 / times, _MOST)
    moves = found.w * early * (1 + float(np.sum(found.w)))
    return replace(found, cov=found.cov + np.outer(moves, moves))


_MOST = 0.5  # of what creeps: of more the first readings show little


def run_seconds(bench: Bench) -> float:
    """s from the first sample of a run to its last, mean over runs."""
    data = bench.data
    number = np.unique(data.run, return_inverse=True)[1]
    first = np.full(number.max() + 1, np.inf)
    last = np.full(number.max() + 1, -np.inf)
    np.minimum.at(first, number, data.time)
    np.maximum.at(last, number, data.time)
    return float(np.mean(last - first))


def _describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: Kelvin-Voigt elements with their retardation time."""
    joint, unit = int(v.info["joint"]), float(bench.compliance[int(v.info["joint"])])
    name = "compliance"
    if v.info.get("bent"):
        name, unit = "compliance_quadratic", unit / float(np.abs(bench.true_torque[:, joint]).max())
    times = np.asarray(v.info["times_s"])
    terms = tuple(Term(name, {"retardation_time": float(t)}) for t in times)
    more: dict[str, Any] = {"forgets": ANEW} if v.info["memory"] else {}
    more |= {STOOD_ON: v.info["stood"]} if v.info.get("stood") else {}
    more |= {RESTED: v.info["rested"]} if v.info.get("rested") else {}
    return Law({"joint": joint} | more, terms), unit * in_a_run(bench, times)


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Retarded torques, or their squares, on the session clock."""
    joint = law.constants["joint"]
    times = np.array([t.shape["retardation_time"] for t in law.terms])
    bent = np.array([t.coefficient == "compliance_quadratic" for t in law.terms])
    torque = bench.true_torque[:, joint][:, None]
    load = np.where(bent, torque * np.abs(torque), torque)
    fresh = bench.rebuilt if law.constants.get("forgets") == ANEW else None
    stood, rested = float(law.constants.get(STOOD_ON, 0.0)), law.constants.get(RESTED)
    z = retarded(load, times, bench.rows, bench.rest, fresh, stood, rested)
    return [bench.joint_column(joint, bench.sense * column) for column in z.T]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns),
    lengths=("creep_fraction", "creep_fraction_of_run"),
    finer=_look_closer,
    not_negative=("creep_fraction", "creep_fraction_of_run"),
)
