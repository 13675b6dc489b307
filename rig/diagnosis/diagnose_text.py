"""The diagnosis on the terminal: answer, where, effects, how far, what next."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, TypeVar

from rig.digits import brief, likely
from rig.units import MM_PER_M

if TYPE_CHECKING:
    from identification.gap.answer.result import EffectFound, GapResult
    from identification.gap.explanations.explanation import GapPattern
    from identification.gap.laws.interval import Parameter
    from identification.gap.model.bench import Bench

_MORE_WRITTEN = 1.1  # times what is left: then a model file says so by itself
_MORE = 1.01  # times the rest that is not left by rounding

# One line a word: what happens there.
MEANING = {
    "joint_yield": "a joint gives way above a threshold torque",
    "joint_backlash": "a joint has lost motion where its torque passes zero",
    "joint_nonlinear_stiffness": "a joint's spring is curved, reversibly",
    "joint_hysteresis": "a joint rubs: loading and unloading differ from the first load on",
    "joint_creep": "a joint creeps under the held load",
    "link_flexibility": "arm segments bend",
    "base_compliance": "the mounting gives way elastically",
    "base_slip": "the mounting slips above a threshold moment",
    "contact_seating": "the fixture between flange and target seats itself",
    "load_misalignment": "the load acts askew",
    "force_drift": "the amplifier drifts",
    "force_scale": "the gain of the force chain is off",
    "displacement_scale": "the gain of the laser is off",
    "thermal_drift": "the displacement drifts with time or temperature",
    "zero_shift": "the datum jumps between repetitions",
    "time_lag": "one channel lags the other",
    "pose_error": "arm or tool stand elsewhere than simulated",
    "joint_stiffness_error": "the joints' stiffnesses are not the simulated ones",
}

# Of a rig without an arm, of which all words speak of one spring.
_OF_ONE_SPRING = {
    "joint_yield": "it gives way above a threshold load",
    "joint_backlash": "there is lost motion where the load passes zero",
    "joint_nonlinear_stiffness": "the spring is curved, reversibly",
    "joint_hysteresis": "it rubs: loading and unloading differ from the first load on",
    "joint_creep": "it creeps under the held load",
    "contact_seating": "what is loaded seats itself in its fixture",
    "displacement_scale": "the gain of the displacement sensor is off",
    "joint_stiffness_error": "the stiffness is not the simulated one",
}


_SHARE = "share_through_friction"
# Parameters whose name alone misleads: a share of a compliance ends at 1, a stiffness does not.
_HELD_BACK = "of the compliance, what friction holds back until it slips; 1: nothing moves before"
_STIFFER = "how stiff the friction is until it slips, over the spring's stiffness; it may pass 1"
_BEYOND = "slope_beyond_over_elastic"
_ADDED = "compliance added beyond the threshold, over the elastic one; 1: twice as soft there"
_LOST = "stiffness lost beyond the threshold, over the elastic one; 1: none is left there"
_NAMES = {
    "creep_fraction": "what creeps in the end, over the elastic deflection",
    "creep_fraction_of_run": "the same once a load has stood for `run`, the mean length of a run",
}
_BENDS = "change_of_compliance_over_range"
_SOFTER = "compliance at the largest load less that at none, over that at none"
_WEAKER = "share of the stiffness at no load that is lost at the largest stroke"


def parameter_meanings(r: GapResult) -> dict[str, str]:
    """Parameter -> what its number is, of those found whose name alone does not say it. Of a rig
    without an arm whose displacement is imposed, springs and friction are stiffnesses beside each
    other."""
    beside = not r.bench.data.arm and r.bench.imposed
    found = {name for e in r.effects for name in e.parameters}
    told = (
        {_SHARE: _STIFFER, _BEYOND: _LOST, _BENDS: _WEAKER}
        if beside
        else {_SHARE: _HELD_BACK, _BEYOND: _ADDED, _BENDS: _SOFTER}
    )
    return {name: meaning for name, meaning in {**told, **_NAMES}.items() if name in found}


# What is said in place of a word's meaning.
OTHERWISE = {
    "none": "noise, gains and stiffnesses within their stated uncertainty explain all",
    "unknown": "a gap that no effect of the library explains",
}
LEAST_PROBABILITY = 0.015  # of a word that is listed: doubt leaves about a hundredth to each


def meanings(*, arm: bool) -> dict[str, str]:
    """Word -> what happens there, in a line."""
    return MEANING if arm else MEANING | _OF_ONE_SPRING


# What an unknown gap looks like, where to look for it, and what would show it by itself; {}: its
# period, and three of them.
LOOKS_LIKE = {
    "slopes": "every run has a stiffness of its own: see to what is fastened anew between runs, "
    "and to the specimen; to be sure, repeat runs without touching the rig",
    "wanders": "the stiffness wanders during the session: see to bolts that loosen, and to damage; "
    "to be sure, measure again now",
    "swings": "the displacement swings with time, {} a period: air conditioning, a pump, a machine "
    "next door, or the mains, which beat with the sampling; to be sure, watch the unloaded rig for "
    "{}",
    "waves": "a wave over the stroke, {} long: the screw's thread, or what the laser's spot "
    "travels over; to be sure, shift the laser's spot a little to the side, and measure again",
    "rough": "every level of the load is off by an amount of its own, the same whenever it is met: "
    "bumps, cross-talk or a damaged instrument; to be sure, measure between these levels",
    "jumps": "the displacement jumps between holds, elsewhere in every run: see to what sticks and "
    "lets go, and to the laser's mounting; to be sure, hold one load for long",
    "settles": "the displacement goes on while the load stands, and not as a joint creeps: see to "
    "what rig and laser stand on, and to glue, rubber or wood; to be sure, hold one load for long, "
    "then none",
    "jerks": "it jumps at a few places, and stays there: a grip that slips, a part that cracks, a "
    "counter that loses pulses; to be sure, look at the curve there, and repeat the run",
    "damage": "it gets softer for good, the further it was loaded: fibres or bonds that break; to "
    "be sure, load it again, half as far",
    "softening": "below the largest load so far it is softer than it was on the way there, as "
    "rubber is (Mullins); to be sure, load it to one top three times, then further",
}
# Of a rig without an arm, whose displacement may be read by anything.
_BY_ANY_SENSOR = {
    "wanders": "the stiffness goes its own way in time: fatigue, cure, humidity, a pressure that "
    "nobody holds, an amplifier that changes its range; to be sure, go through the same strokes "
    "again now",
    "waves": "a wave over the stroke, {} long: a screw's thread, or the scale that the sensor "
    "reads; to be sure, begin the stroke elsewhere, and measure again",
    "jumps": "the displacement jumps between holds, elsewhere in every run: see to what sticks and "
    "lets go, and to the sensor's mounting; to be sure, hold one load for long",
}
_SURE = 3  # periods


# Kinds of notes, and under which heading they stand: the first kind right after the answer, which
# it makes doubtful, the others at the end.
NOTED = {
    "fault": "See to this first",
    "set aside": "Set aside",
    "undecided": "Not decidable from these data",
    "remark": "To be known",
}
DOUBTED = next(iter(NOTED))


def looks_like(like: GapPattern, *, arm: bool = True) -> str:
    """In words, with the period in its unit."""
    period = like.period or 0.0
    told = [f"{brief(t, 3)} s" for t in (period, _SURE * period)]
    if like.kind == "waves":
        told = [f"{brief(period * MM_PER_M, 3)} mm"]
    words = LOOKS_LIKE if arm else LOOKS_LIKE | _BY_ANY_SENSOR
    return words["wanders" if like.wanders else like.kind].format(*told)


def render(r: GapResult) -> str:
    """All lines, in the order of importance."""
    others = [_noted(r, kind) for kind in NOTED if kind != DOUBTED]
    parts = [_answer(r), _noted(r, DOUBTED), _where(r), _effects(r), _gap(r), _next(r), *others]
    return "\n\n".join(p for p in parts if p)


def _noted(r: GapResult, kind: str) -> str:
    """The notes of a kind under their heading; empty where there are none."""
    told = [f"  {n.text}" for n in r.said if n.kind == kind]
    return "\n".join([f"{NOTED[kind]}:", *told]) if told else ""


def _answer(r: GapResult) -> str:
    before, after, noise = (brief(v * MM_PER_M, 3) for v in (r.before, r.after, r.noise))
    like = None if r.looks_like is None else looks_like(r.looks_like, arm=r.bench.data.arm)
    meaning = meanings(arm=r.bench.data.arm).get(r.verdict, "")
    met = r.verdict == "unknown" and r.met
    nothing, hidden = r.learned_nothing, r.hidden
    told = answer(r.verdict, meaning, r.names, like, nothing=nothing, met=met, hidden=hidden)
    shown = told.format(before=before, after=after, noise=noise)
    return f"{r.verdict} ({likely(r.probabilities[r.verdict])}): {shown}"


def answer(
    verdict: str,
    meaning: str,
    names: Iterable[str],
    like: str | None,
    *,
    nothing: bool,
    met: bool,
    hidden: bool,
) -> str:
    """What a verdict says, with {before}, {after} and {noise} where rms in mm are to stand. names:
    of the effects; like: what an unknown gap looks like; nothing: that was learned; met: what is
    left of the displacement is no more than noise; hidden: it is no more than readings scatter."""
    alone = "the instruments alone leave {noise} mm."
    if nothing:
        return (
            "nothing can be said of a gap, since nothing moved that could show one. The "
            "probabilities are those from before the measurement."
        )
    if verdict == "none":
        return (
            f"{OTHERWISE[verdict]} that was measured. There is no gap to close. Of the {{before}} "
            "mm rms that the simulation misses as it stands, {after} mm remain when these are "
            f"fitted within that; {alone}"
        )
    if hidden:
        return (
            "the readings scatter far more than META states, and what makes them do so is not "
            "known: {after} of {before} mm rms remain, the scatter alone leaves {noise} mm. A "
            "smaller gap would not be seen."
        )
    if verdict == "unknown" and met:
        return (
            "the displacement is met without any effect, {after} of {before} mm rms remain, and "
            f"{alone} But that takes springs, gains or readings farther off than META states, and "
            "no effect of the library is believed to be the reason."
        )
    if verdict == "unknown":
        alike = "" if like is None else f" It looks like this: {like}."
        return (
            "there is a gap, and no effect of the library explains it down to the uncertainty: "
            f"{{after}} of {{before}} mm rms remain; {alone}{alike}"
        )
    more = [name for name in dict.fromkeys(names) if name != verdict]
    beside = f" Beside it: {', '.join(more)}." if more else ""
    them = "all of them" if more else "it"
    return (
        f"{meaning}.{beside} With {them} the gap shrinks from {{before}} to {{after}} mm rms; "
        f"{alone}"
    )


def _where(r: GapResult) -> str:
    from identification.gap.words import IN_JOINTS, SPRINGS

    w = r.where
    if not w.directions or not any(force != (0.0, 0.0) for force in w.force.values()):
        return ""
    forces = ", ".join(f"{d}: {brief(a)} to {brief(b)} N" for d, (a, b) in w.force.items())
    lines = [f"Where ({_share(w.share)} of the gap that springs leave)", f"  directions  {forces}"]
    if w.poses:
        lines.append(f"  poses       {', '.join(w.poses)}")
    lines.append(f"  branches    {', '.join(w.branches)}")
    lines.append(f"  repetitions {', '.join(map(str, w.repetitions))}")
    if w.joints:
        theirs = [name for name in r.names if name in IN_JOINTS | {SPRINGS}]
        whose = "" if r.verdict in theirs else f" ({', '.join(theirs)})"
        lines.append(f"  joints      {', '.join(map(str, w.joints))}{whose}")
    if w.seen_by_encoders is not None:
        what = r.verdict if len(r.names) > 1 else "it"
        lines.append(f"  the joint readings {'see' if w.seen_by_encoders else 'do not see'} {what}")
    return "\n".join(lines)


def _effects(r: GapResult) -> str:
    lines = ["Effects"] if r.effects else []
    for e in r.effects:
        lines += _one_effect(e, _title(e, [other.name for other in r.effects]))
    lines += [f"  {name}: {told}" for name, told in parameter_meanings(r).items()]
    ranked = sorted(r.probabilities.items(), key=lambda i: -i[1])
    shown = [f"{w} {likely(p)}" for w, p in ranked if p >= LEAST_PROBABILITY]
    shown.append(f"all others together {likely(sum(p for _, p in ranked[len(shown) :]))}")
    lines.append(f"Probability of being the main cause: {', '.join(shown)}")
    return "\n".join(lines)


def _title(e: EffectFound, names: list[str]) -> str:
    """Its name; with where it sits, if that is known, or it sits in several joints."""
    place = next(iter(e.places), "")
    told = len(e.places) == 1 or names.count(e.name) > 1
    return f"{e.name}, {place}" if place and told else e.name


def _one_effect(e: EffectFound, title: str) -> list[str]:
    lines = [
        f"  {title}: present with a probability of {likely(e.probability)}; does "
        f"{_share(e.share_of_gap)} of the gap"
    ]
    if len(e.places) > 1:
        each = ", ".join(f"{place} ({likely(p)})" for place, p in e.places.items())
        lines.append(f"    these data leave open where it sits: {each}")
    lines += _parameters(e.parameters)
    if e.parameters and e.probability > _SURELY and all(_open(p) for p in e.parameters.values()):
        lines.append("    surer that it is there than how large, or which way it goes, alone")
    if e.indistinguishable_from:
        lines.append(f"    can't be told apart from {', '.join(e.indistinguishable_from)} here")
    return lines


_SURELY = 0.95  # there


def _open(p: Parameter) -> bool:
    """Whether its interval leaves open which way it goes."""
    return p.low < 0 < p.high or (p.low < p.high and 0 in (p.low, p.high))


T = TypeVar("T")
_OF_RUN = re.compile(r"(.+)_run\d+$")
EACH = 2  # runs that are listed one by one


def _share(value: float) -> str:
    """What is there is more than nothing of the gap."""
    whole = round(100 * value)
    return "less than 1 %" if whole == 0 else f"{whole} %"


def families(found: Mapping[str, T]) -> dict[str, dict[str, T]]:
    """Parameters by their names; what runs have each to themselves under one name."""
    out: dict[str, dict[str, T]] = {}
    for name, p in found.items():
        of_run = _OF_RUN.match(name)
        out.setdefault(of_run[1] if of_run else name, {})[name] = p
    return out


def _parameters(found: Mapping[str, Parameter]) -> list[str]:
    """A line each; what many runs have each to themselves is one line, its range."""
    lines = []
    for family, members in families(found).items():
        if len(members) <= EACH:
            lines += [f"    {name} = {_value(p)}" for name, p in members.items()]
            continue
        each = list(members.values())
        low, high = min(p.value for p in each), max(p.value for p in each)
        wide = max(max(p.high - p.value, p.value - p.low) for p in each)
        unit = "" if each[0].unit == "1" else f" {each[0].unit}"
        lines.append(
            f"    {family} = {brief(low)} to {brief(high)}{unit} in {len(each)} runs"
            f" (95 %: each +- {wide:.2g}{unit} at most; one by one in the JSON)"
        )
    return lines


def _value(p: Parameter) -> str:
    unit = "" if p.unit == "1" else f" {p.unit}"
    largest = "" if p.cut_at is None else f"; the largest seen is {brief(p.cut_at)}{unit}"
    ended = p.low < p.high and p.value in (p.low, p.high)
    limit = "; at the limit of what is possible" if ended else ""
    return f"{brief(p.value)}{unit} (95 %: {brief(p.low)} to {brief(p.high)}{unit}{largest}{limit})"


def _gap(r: GapResult) -> str:
    lines = [
        "How far (rms, mm)",
        "                           before     after after/noise  shrinks by",
        _row("fitted", r.before, r.after, r.noise),
    ]
    if r.written is not None and r.effects and r.written > _MORE_WRITTEN * r.after:
        lines.append(_row("in a model file", r.before, r.written, r.noise))
    if r.without_added is not None:
        lines.append(_row("without what was added", r.before, r.without_added, r.noise))
        if r.after > _MORE * r.without_added:
            lines.append("  What was added is no explanation: more is left with it than without.")
    for h in r.held_out:
        if not max(h.before, h.after) > 0:
            continue  # nothing to judge there
        low, high = h.ci95
        open_to = f" ({brief(low, 3)} to {brief(high, 3)})" if low < high else ""
        lines.append(_row(f"withheld {h.fold}", h.before, h.after, r.noise) + open_to)
    lines.append(f"  {'noise of the instruments':32s}{brief(r.noise * MM_PER_M):>9s}")
    told = less_datum(h.fold for h in r.held_out if h.own_datum)
    lines += [f"  {told}"] if told else []
    lines += [f"  {told}"] if (told := in_newtons(r.bench)) else []
    for word, after in r.runners_up.items():
        lines.append(f"  withheld, with {word} alone: {brief(after * MM_PER_M)}")
    return "\n".join(lines)


def in_newtons(bench: Bench) -> str:
    """What a millimetre of the gap is, where it is one of force; empty where it is none."""
    if not bench.imposed or bench.data.arm:
        return ""
    data = bench.data
    along = [f" along {data.spring_name(j)}" if data.joints > 1 else "" for j in range(data.joints)]
    each = [
        f"{brief(1 / (MM_PER_M * c))} N{of}" for c, of in zip(data.compliance, along, strict=True)
    ]
    return f"the gap is one of force, over the simulated stiffness: 1 mm is {', '.join(each)}"


def less_datum(folds: Iterable[str]) -> str:
    """What is said of folds that took their datum with them; empty where there are none."""
    named = ", ".join(folds)
    return f"withheld {named}: after is less the datum, which no model can know" if named else ""


def _row(name: str, before: float, after: float, noise: float) -> str:
    shrink = brief(before / after, 3) if min(before, after) > 0 else "-"
    ratio = after / noise if noise > 0 else 1.0
    shown = f"{brief(before * MM_PER_M):>9s} {brief(after * MM_PER_M):>9s} {ratio:11.2f}"
    return f"  {name:22s}{shown}  {shrink:>6s}"


def _next(r: GapResult) -> str:
    if r.next_measurement is None:
        return ""
    from identification.gap.answer.discriminate import (
        ENOUGH,  # the report takes only words from here
    )

    first, second = r.next_measurement.separates
    lines = [f"Next, to tell {first} from {second}:", f"  {r.next_measurement.text}"]
    others = [o for o in r.next_measurement.alternatives if o.expected_nats >= ENOUGH]
    if others and r.next_measurement.kind != "none":
        shown = ", ".join(f"{o.kind} ({o.minutes:.0f} min)" for o in others[:4])
        lines.append(f"  Other procedures that would do: {shown}.")
    return "\n".join(lines)
