"""One case opened: the answers beside what was said.

The words used here are those of docs/blind.md, whose definitions these functions are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from rig.blind.campaign import Outcome
from rig.blind.case import plain

Kind = Literal["none", "unknown", "single", "mixture", "partial"]

# Parameters that answers and diagnosis define alike: (word, key of the answers) -> key found.
# {} stands for what the answers' own keys below it are: directions or joints.
SHARED = {
    ("joint_yield", "threshold_Nm"): "threshold",
    ("joint_yield", "threshold_of_load_Nm"): "threshold_of_load",
    ("base_slip", "threshold_Nm"): "threshold",
    ("joint_backlash", "width_rad"): "width",
    ("joint_creep", "creep_fraction"): "creep_fraction",
    ("joint_creep", "creep_fraction_of_run"): "creep_fraction_of_run",
    ("contact_seating", "depth_mm"): "depth",
    ("force_scale", "factor"): "factor",
    ("displacement_scale", "factor"): "factor",
    ("time_lag", "lag_s"): "lag",
    ("force_drift", "drift_over_session_N"): "drift_over_session",
    ("thermal_drift", "drift_over_session_mm"): "drift_over_session_{}",
    **{("joint_stiffness_error", f"factor_joint{j}"): f"factor_joint{j}" for j in range(1, 7)},
}


@dataclass(frozen=True, eq=False)
class Judged:
    """A case with its marks.

    kind: `partial` is a mixture that has lost a word to --withhold. main: the effect with the
    largest share of the gap, which the probabilities are about; `unknown` where it was withheld.
    accept: words that count as right. stands_in: words that explain the case without the
    withheld one. right, in_set, exact: see docs/blind.md. found: words of the explanation.
    """

    outcome: Outcome
    kind: Kind
    main: str
    accept: frozenset[str]
    stands_in: frozenset[str]
    verdict: str
    right: bool
    in_set: bool
    exact: bool
    found: tuple[str, ...]

    @property
    def label(self) -> dict[str, Any]:
        """The answers."""
        return self.outcome.label

    @property
    def diagnosis(self) -> dict[str, Any]:
        """What was said; empty if nothing came."""
        return self.outcome.reply.diagnosis or {}

    @property
    def snr(self) -> float:
        """rms of the structural gap over rms of the noise."""
        return float(self.label.get("snr") or 0.0)

    @property
    def laws(self) -> str:
        """`fitted`, `foreign` or `mixed`: of the effects in the case; empty without."""
        laws = self.label.get("laws") or []
        kinds = {laws} if isinstance(laws, str) else set(laws)
        if not kinds or self.label["truth"] in (["none"], ["unknown"]):
            return ""
        return str(kinds.pop()) if len(kinds) == 1 else "mixed"

    def probability(self, word: str) -> float:
        """Of a word, as the diagnosis gave it; 0 if nothing came."""
        return float(self.diagnosis.get("probabilities", {}).get(word, 0.0))

    @property
    def top(self) -> float:
        """The probability of the verdict."""
        return self.probability(self.verdict)


def judge(outcome: Outcome) -> Judged:
    """The marks of one case. What did not come back counts as wrong in every respect."""
    label, diagnosis = outcome.label, outcome.reply.diagnosis or {}
    truth = tuple(label["truth"])
    kind = _kind(truth, outcome.withheld)
    main = "unknown" if kind == "unknown" else _main(label, outcome.withheld)
    stands_in = frozenset(label["accept"]) - {outcome.withheld}
    lost = outcome.withheld in truth
    accept = stands_in | {"unknown"} if lost else stands_in
    verdict = str(diagnosis.get("verdict", ""))
    effects = diagnosis.get("effects", [])
    right = verdict in accept
    alike = {w for e in effects if e["name"] == verdict for w in e["indistinguishable_from"]}
    truths = {main} if kind in ("none", "unknown") else set(truth) - {outcome.withheld}
    return Judged(
        outcome=outcome,
        kind=kind,
        main=main,
        accept=frozenset(accept),
        stands_in=stands_in if lost else frozenset(),
        verdict=verdict,
        right=right,
        in_set=right or bool(truths & alike),
        exact=verdict == main,
        found=tuple(dict.fromkeys(str(e["name"]) for e in effects)),
    )


def _kind(truth: tuple[str, ...], withheld: str | None) -> Kind:
    if truth == ("none",):
        return "none"
    if truth in (("unknown",), (withheld,)):
        return "unknown"
    if len(truth) == 1:
        return "single"
    return "partial" if withheld in truth else "mixture"


def _main(label: dict[str, Any], withheld: str | None) -> str:
    """The effect that alone makes the largest gap, of those in the library; of equals the first."""
    truth = list(label["truth"])
    each = label.get("snr_each") or [0.0] * len(truth)
    sizes = {w: float(s) for w, s in zip(truth, each, strict=False) if w != withheld}
    return max(sizes, key=lambda w: sizes[w]) if sizes else str(truth[0])


def matched(judged: Judged) -> tuple[int, int, int]:
    """Of a mixture: hits, false words, missed effects.

    An effect is hit by a found word that the answers accept for it, each word and effect once.
    """
    truth = judged.label["truth"]
    each = judged.label.get("accept_each") or [[w] for w in truth]
    free, hits = list(dict.fromkeys(judged.found)), 0
    # Its own word first, so that a stand-in is not spent where the word itself would serve.
    open_ = []
    for word, accepted in zip(truth, each, strict=True):
        if word in free:
            free.remove(word)
            hits += 1
        else:
            open_.append(set(accepted))
    for accepted in open_:
        word = next((w for w in free if w in accepted), None)
        if word is not None:
            free.remove(word)
            hits += 1
    return hits, len(free), len(truth) - hits


def joint_right(judged: Judged) -> bool | None:
    """Whether exactly the true joints were named; None where no joint is asked for."""
    where = judged.label.get("where") or {}
    if not judged.main.startswith("joint_") or not where.get("joints"):
        return None
    return set(where["joints"]) == set(judged.diagnosis.get("where", {}).get("joints", []))


def direction_right(judged: Judged) -> bool | None:
    """Whether the direction with the largest gap is among those named."""
    where = judged.label.get("where") or {}
    if not where.get("main_direction"):
        return None
    return where["main_direction"] in judged.diagnosis.get("where", {}).get("directions", [])


def directions_same(judged: Judged) -> bool | None:
    """Whether exactly the directions in which the effect shows were named."""
    where = judged.label.get("where") or {}
    if not where.get("directions"):
        return None
    named = judged.diagnosis.get("where", {}).get("directions", [])
    return set(where["directions"]) == set(named)


def encoders_right(judged: Judged) -> bool | None:
    """Whether the joint readings see it; None where the answers don't say."""
    seen = (judged.label.get("where") or {}).get("seen_by_encoders")
    if seen is None:
        return None
    return bool(seen) is judged.diagnosis.get("where", {}).get("seen_by_encoders")


def intervals(judged: Judged) -> list[dict[str, Any]]:
    """Parameters that answers and diagnosis share, of effects that were found under their word.

    Of each: word, parameter, true, value, ci95, ci90, and whether the intervals hold the truth.
    """
    if judged.kind not in ("single", "mixture") or judged.outcome.withheld in judged.label["truth"]:
        return []
    out = []
    # the largest first: what sits in several joints is judged by that
    found = {e["name"]: e["parameters"] for e in judged.diagnosis.get("effects", [])[::-1]}
    rows = zip(judged.label["truth"], judged.label.get("parameters") or [], strict=False)
    for word, answers in rows:
        for name, true in _true_values(word, answers):
            read = found.get(word, {})
            # where no weight hangs on the joint, the load is all there is
            given = read.get(name) or read.get(name.removesuffix("_of_load"))
            if given is not None:
                out.append({"word": word, "parameter": name, **_covers(true, given)})
    return out


def _true_values(word: str, answers: dict[str, Any]) -> list[tuple[str, float]]:
    out: list[tuple[str, float]] = []
    for (of, key), name in SHARED.items():
        value = answers.get(key) if of == word else None
        if isinstance(value, dict):
            out += [(name.format(k), float(v)) for k, v in value.items()]
        elif isinstance(value, int | float):
            out.append((name, float(value)))
    return out


def _covers(true: float, given: dict[str, Any]) -> dict[str, Any]:
    value, (low, high) = given["value"], given["ci95"]
    low90, high90 = given["ci90"]
    return {
        "true": true,
        "value": value,
        "ci95": [low, high],
        "ci90": [low90, high90],
        "in_95": low <= true <= high,
        "in_90": low90 <= true <= high90,
    }


def case_json(judged: Judged) -> dict[str, Any]:
    """Everything about one case, as JSON can hold it."""
    reply, o = judged.outcome.reply, judged.outcome
    return {
        "name": o.name,
        "number": o.number,
        "withheld": o.withheld,
        "status": reply.status,
        "reason": reply.reason,
        "seconds": reply.seconds,
        "kind": judged.kind,
        "main": judged.main,
        "accept": sorted(judged.accept),
        "verdict": judged.verdict,
        "right": judged.right,
        "right_or_in_set": judged.in_set,
        "exact": judged.exact,
        "intervals": plain(intervals(judged)),
        "answers": plain(judged.label),
        "diagnosis": plain(judged.diagnosis),
    }
