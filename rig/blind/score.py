"""The score of a campaign, as one JSON document; docs/blind.md defines its figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from rig import schemas
from rig.blind import judge as j
from rig.blind.campaign import Campaign
from rig.blind.judge import Judged
from rig.blind.rates import auroc, ece, ece_by_chance, quantiles, rate, reliability
from rig.software import software_version

BINS = ((0.0, 1.5), (1.5, 3.0), (3.0, 10.0), (10.0, float("inf")))


def report(campaign: Campaign) -> dict[str, Any]:
    """Summary, tables and every case. Simulated data throughout: the document says so."""
    judged = [j.judge(o) for o in campaign.outcomes]
    plan = campaign.plan
    clear = [c for c in judged if c.kind == "none" or c.snr >= plan.snr_min]
    return {
        "schema": schemas.BLIND,
        "simulated": True,
        "command": plan.command,
        "seed": plan.seed,
        "generator": plan.generator,
        "word": plan.word,
        "withhold": plan.withhold,
        "software": software_version(),
        "cases_asked": plan.cases,
        "cases_done": len(judged),
        "interrupted": campaign.interrupted,
        "snr_min": plan.snr_min,
        "summary": summary(clear, judged),
        "tables": tables(clear, judged),
        "failures": [
            {
                "name": c.outcome.name,
                "status": c.outcome.reply.status,
                "reason": c.outcome.reply.reason,
            }
            for c in judged
            if c.outcome.reply.status != "answered"
        ],
        "undrawn": [{"number": n, "reason": reason} for n, reason in campaign.undrawn],
        "cases": [j.case_json(c) for c in judged],
    }


def summary(clear: list[Judged], judged: list[Judged]) -> dict[str, Any]:
    """The figures that have targets. clear: cases whose gap is large enough; judged: all."""
    singles = [c for c in clear if c.kind == "single"]
    known = [c for c in clear if c.kind in ("single", "mixture")]
    # Where another word explains the case without the withheld one, `unknown` can't be asked for.
    unknown = [c for c in clear if c.kind == "unknown" and not c.stands_in - {"unknown"}]
    named = [c for c in singles if c.exact]
    return {
        "right": rate(c.right for c in singles),
        "right_or_in_set": rate(c.in_set for c in singles),
        "exact": rate(c.exact for c in singles),
        "right_all_kinds": rate(c.right for c in clear),
        "confident_errors": rate(not c.right and c.top > 0.9 for c in clear),
        "false_alarms": rate(c.verdict != "none" for c in clear if c.kind == "none"),
        "unknown_recall": rate(c.verdict == "unknown" for c in unknown),
        "known_called_unknown": rate(c.verdict == "unknown" for c in known),
        "unknown_auroc": auroc(
            [c.probability("unknown") for c in unknown], [c.probability("unknown") for c in known]
        ),
        "mixtures": _mixtures([c for c in clear if c.kind == "mixture"]),
        "calibration": _calibration(clear),
        "where": _where(named),
        "gap": _gap([c for c in clear if c.kind in ("single", "mixture", "none")]),
        "time": _time(judged),
        "crashed_or_late": rate(c.outcome.reply.status != "answered" for c in judged),
    }


def tables(clear: list[Judged], judged: list[Judged]) -> dict[str, Any]:
    """Breakdowns: per effect, by size, by laws, by design, confusion."""
    effects = [c for c in clear if c.kind == "single"]
    sized = [c for c in judged if c.kind == "single"]
    withheld = [c for c in clear if c.kind == "unknown" and c.outcome.withheld]
    return {
        "by_effect": _groups(effects, lambda c: c.main),
        "by_snr": _by_snr(sized),
        "by_laws": _groups(effects, lambda c: c.laws),
        "by_design": _groups(effects, lambda c: str(c.label.get("design", ""))),
        "by_form": _groups(effects, _form),
        "by_kind": _groups(clear, lambda c: c.kind),
        "by_withheld": _groups(withheld, lambda c: str(c.outcome.withheld)),
        "confusion": _confusion(c for c in clear if c.kind not in ("mixture", "partial")),
        "coverage": _coverage(clear),
    }


def _form(c: Judged) -> str:
    forms = c.label.get("forms") or [""]
    return f"{c.main}: {forms[0]} ({c.laws})"


def _groups(cases: Iterable[Judged], key: Callable[[Judged], str]) -> dict[str, Any]:
    groups: dict[str, list[Judged]] = {}
    for c in cases:
        groups.setdefault(key(c), []).append(c)
    return {name: _marks(group) for name, group in sorted(groups.items()) if name}


def _marks(cases: list[Judged]) -> dict[str, Any]:
    wrong = Counter(c.verdict or c.outcome.reply.status for c in cases if not c.right)
    return {
        "right": rate(c.right for c in cases),
        "right_or_in_set": rate(c.in_set for c in cases),
        "exact": rate(c.exact for c in cases),
        "wrong_verdicts": dict(wrong.most_common()),
    }


def _by_snr(cases: list[Judged]) -> dict[str, Any]:
    out = {}
    for low, high in BINS:
        mine = [c for c in cases if low <= c.snr < high]
        if mine:
            out[f"{low:g} to {high:g}" if high < float("inf") else f"over {low:g}"] = _marks(mine)
    return out


def _confusion(cases: Iterable[Judged]) -> dict[str, dict[str, int]]:
    """Rows: what the case holds, `withheld:` before a word taken out; columns: the verdict."""
    rows: dict[str, Counter[str]] = {}
    for c in cases:
        lost = c.kind == "unknown" and c.outcome.withheld in c.label["truth"]
        name = f"withheld:{c.outcome.withheld}" if lost else c.main
        rows.setdefault(name, Counter())[c.verdict or c.outcome.reply.status] += 1
    return {name: dict(rows[name].most_common()) for name in sorted(rows)}


def _mixtures(cases: list[Judged]) -> dict[str, Any]:
    counts = [j.matched(c) for c in cases]
    strict = [(set(c.found), set(c.label["truth"])) for c in cases]
    exact = [(len(f & t), len(f - t), len(t - f)) for f, t in strict]
    return {
        "n": len(cases),
        "f1": _f1(counts),
        "f1_exact_words": _f1(exact),
        "main_cause_right": rate(c.right for c in cases),
        "both_named": rate(
            hit == len(c.label["truth"]) and not extra
            for c, (hit, extra, _) in zip(cases, counts, strict=True)
        ),
    }


def _f1(counts: list[tuple[int, int, int]]) -> float | None:
    """Pooled over the cases: 2 hits / (2 hits + false + missed)."""
    hits, false, missed = (sum(c[i] for c in counts) for i in range(3))
    total = 2 * hits + false + missed
    return 2 * hits / total if total else None


def _calibration(cases: list[Judged]) -> dict[str, Any]:
    """Of the cases that came back, against the main cause; beside it, against what is accepted."""
    came = [c for c in cases if c.diagnosis and c.kind != "partial"]
    top, exact = [c.top for c in came], [c.exact for c in came]
    words = [
        sum((p - (w == c.main)) ** 2 for w, p in c.diagnosis["probabilities"].items()) for c in came
    ]
    covered = [i for c in came for i in j.intervals(c)]
    mean, p95 = ece_by_chance(top)
    return {
        "n": len(came),
        "ece": ece(top, exact),
        "ece_by_chance": {"mean": mean, "p95": p95},
        "ece_against_accepted": ece(top, [c.right for c in came]),
        "brier_top": sum((p - e) ** 2 for p, e in zip(top, exact, strict=True)) / len(came)
        if came
        else None,
        "brier_all_words": sum(words) / len(came) if came else None,
        "reliability": reliability(top, exact),
        "coverage_95": rate(i["in_95"] for i in covered),
        "coverage_90": rate(i["in_90"] for i in covered),
    }


def _coverage(cases: list[Judged]) -> dict[str, Any]:
    """Per word, parameter and laws: how often the intervals hold the truth."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for c in cases:
        for i in j.intervals(c):
            parameter = i["parameter"].rstrip("123456").removesuffix("_x")
            parameter = parameter.removesuffix("_y").removesuffix("_z")
            groups.setdefault(f"{i['word']} {parameter} ({c.laws})", []).append(i)
    return {
        name: {
            "in_95": rate(i["in_95"] for i in rows),
            "in_90": rate(i["in_90"] for i in rows),
            "median_value_over_true": quantiles(
                (i["value"] / i["true"] for i in rows if i["true"]), 0.5
            )[0],
        }
        for name, rows in sorted(groups.items())
    }


def _where(cases: list[Judged]) -> dict[str, Any]:
    """Of single effects named exactly: joint, directions, encoders."""

    def of(check: Callable[[Judged], bool | None], among: list[Judged]) -> dict[str, Any]:
        return rate(mark for mark in map(check, among) if mark is not None)

    readable = [c for c in cases if (c.label.get("where") or {}).get("seen_by_encoders")]
    return {
        "joint": of(j.joint_right, cases),
        "joint_with_readings": of(j.joint_right, readable),
        "main_direction": of(j.direction_right, cases),
        "same_directions": of(j.directions_same, cases),
        "encoders": of(j.encoders_right, cases),
    }


def _gap(cases: list[Judged]) -> dict[str, Any]:
    """rms over the noise as the generator made it; withheld over fitted; runners-up."""
    fitted, held, ratio, shrink, wins = [], [], [], [], []
    for c in cases:
        gap = c.diagnosis.get("gap")
        noise = float(c.label.get("noise_rms_mm") or 0.0)
        if gap is None or not noise > 0:
            continue
        fitted.append(gap["after_rms_mm"] / noise)
        fold = gap["held_out"]
        if fold is None:
            continue
        held.append(fold["after_rms_mm"] / noise)
        if gap["after_rms_mm"] > 0:
            ratio.append(fold["after_rms_mm"] / gap["after_rms_mm"])
        if c.kind == "none":
            continue
        shrink.append(fold["shrink_factor"])
        if c.exact:
            wins += _wins(c, fold["after_rms_mm"])
    names = ("median", "p90")
    return {
        "n": len(fitted),
        "n_withheld": len(held),
        "fitted_over_noise": dict(zip(names, quantiles(fitted, 0.5, 0.9), strict=True)),
        "withheld_over_noise": dict(zip(names, quantiles(held, 0.5, 0.9), strict=True)),
        "withheld_over_fitted": dict(zip(names, quantiles(ratio, 0.5, 0.9), strict=True)),
        "shrink_withheld": dict(
            zip(("p10", *names), quantiles(shrink, 0.1, 0.5, 0.9), strict=True)
        ),
        "beats_wrong_runners_up": rate(wins),
    }


def _wins(c: Judged, after_mm: float) -> list[bool]:
    """Whether the named effect leaves less on withheld data than each word that is not accepted."""
    return [
        after_mm < other["held_out_after_rms_mm"]
        for word, other in c.diagnosis.get("runners_up", {}).items()
        if word not in c.accept
    ]


def _time(cases: list[Judged]) -> dict[str, Any]:
    seconds = [c.outcome.reply.seconds for c in cases if c.outcome.reply.status == "answered"]
    median, p95 = quantiles(seconds, 0.5, 0.95)
    return {
        "n": len(seconds),
        "median_s": median,
        "p95_s": p95,
        "slowest_s": max(seconds, default=None),
    }
