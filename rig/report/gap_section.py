"""The chapter on the sim-to-real gap: answer, where, which effects, how far, what next."""

from __future__ import annotations

import re
from collections.abc import Iterator

from rig.diagnosis.diagnose_text import (
    DOUBTED,
    EACH,
    LEAST_PROBABILITY,
    NOTED,
    OTHERWISE,
    answer,
    families,
    less_datum,
)
from rig.report.document import (
    Block,
    Bullets,
    Cell,
    Facts,
    Paragraph,
    Rich,
    Section,
    Table,
    Word,
    row,
)
from rig.report.gather import Session
from rig.report.results import NOTHING, Node


def gap(session: Session, data: Node) -> Section:
    """The sim-to-real gap: answer, where, which effects, how far, what next."""
    banners, found = session.dataset.banners(), data["diagnose"]
    if not found:
        reason = data["missing"]["diagnose"].text()
        return Section("gap", "Gap to the simulation", (Paragraph((reason,), "warning"),), banners)
    figures = session.diagnosed.figures
    blocks: list[Block] = [Paragraph(_answer(found), "answer"), *_noted(found, DOUBTED)]
    blocks += [*_where(found), *figures[:2]]
    blocks += [*_effects(found), _probabilities(found), _how_far(found), *figures[2:]]
    blocks += _next(found)
    blocks += [b for kind in NOTED if kind != DOUBTED for b in _noted(found, kind)]
    return Section("gap", "Gap to the simulation", tuple(blocks), banners)


def _answer(found: Node) -> Rich:
    """As `rig diagnose` has it, with the numbers of the JSON."""
    verdict, like = found["verdict"].text(), found["looks_like"]
    told = answer(
        verdict,
        "" if verdict in OTHERWISE else found["meanings"][verdict].text(),
        [e["name"].text() for e in found["effects"]],
        None if like.value is None else like["text"].text(),
        nothing=found["nothing_learned"].value,
        met=found["displacement_met"].value,
        hidden=found["hidden_by_scatter"].value,
    )
    sizes = {k: found["gap"][f"{k}_rms_mm"].number(3) for k in ("before", "after", "noise")}
    parts = re.split(r"\{(before|after|noise)\}", told)
    shown = [p for i, part in enumerate(parts) for p in (sizes[part] if i % 2 else (part,))]
    p = found["probabilities"][verdict].probability()
    return (Word(verdict, "strong"), " (", *p, "): ", *shown)


def _where(found: Node) -> list[Block]:
    where = found["where"]
    if not where["directions"]:
        return []
    rows: list[tuple[str, Cell]] = [
        (f"Force, direction {d}", (*ends.interval(), " N")) for d, ends in where["force_N"].items()
    ]
    for key, name in (
        ("poses", "Poses"),
        ("branches", "Branches"),
        ("repetitions", "Repetitions"),
        ("joints", "Joints"),
    ):
        words = ", ".join(str(v) for v in where[key].value if v != "")
        if words:
            rows.append((name, words))
    seen = where["seen_by_encoders"].value
    if seen is not None:
        rows.append(("Joint readings", "see it" if seen else "do not see it"))
    rows.append(("Share of the gap there", where["share_of_gap"].percent()))
    return [Section("gap-where", "Where", (Facts(tuple(rows)),))]


def _effects(found: Node) -> list[Block]:
    rows: list[tuple[Cell, ...]] = []
    alike: list[Cell] = []
    words = [e["name"].text() for e in found["effects"]]
    for e in found["effects"]:
        name, empty = e["name"].text(), (NOTHING,)
        if words.count(name) > 1:  # one mechanism in several joints
            name = ", ".join([name, *list(e["places"].value)[:1]])
        head: tuple[Cell, ...] = (
            Word(name, "strong"),
            e["probability"].probability(),
            e["share_of_gap"].share(),
        )
        parameters = [
            (
                key,
                p["unit"].text(),
                p["value"].number(),
                p["ci95"][0].number(),
                p["ci95"][1].number(),
            )
            for key, p in _told(e["parameters"])
        ] or [("", "", empty, empty, empty)]
        for i, (key, unit, *numbers) in enumerate(parameters):
            lead = head if i == 0 else ("", "", "")
            rows.append((lead[0], key, "" if unit == "1" else unit, *numbers, *lead[1:]))
        if len(e["places"].value) > 1:
            alike.append(_places(name, e["places"]))
        others = e["indistinguishable_from"].value
        if others:
            alike.append(f"{name} can't be told apart from {', '.join(others)} in these data.")
    alike += [f"{name}: {told.text()}." for name, told in found["parameter_meanings"].items()]
    if not rows:
        return []
    header = ("effect", "parameter", "unit", "value", "95 % from", "to", "present", "of the gap")
    blocks: list[Block] = [Table("Effects of the chosen explanation", header, tuple(rows), 3)]
    return [*blocks, Bullets(tuple(alike))] if alike else blocks


def _told(parameters: Node) -> Iterator[tuple[str, Node]]:
    """Parameters by what they are called; of what many runs have each to themselves the ends of the
    range. The JSON lists all."""
    for members in families(dict(parameters.items())).values():
        if len(members) <= EACH:
            yield from members.items()
            continue
        ranked = sorted(members.items(), key=lambda member: member[1]["value"].value)
        for (name, node), end in ((ranked[0], "least"), (ranked[-1], "largest")):
            yield f"{name}, the {end} of {len(ranked)} runs", node


def _places(name: str, places: Node) -> Rich:
    """Where an effect may sit, where the data leave that open."""
    each: list[Rich] = [(f"{place} (", *p.probability(), ")") for place, p in places.items()]
    listed = [part for one in each for part in (*one, ", ")]
    return (f"Where {name} sits, these data leave open: ", *listed[:-1], ".")


def _probabilities(found: Node) -> Table:
    ranked = sorted(found["probabilities"].items(), key=lambda i: -i[1].value)
    rows = tuple(
        (word, OTHERWISE.get(word) or found["meanings"][word].text(), p.probability())
        for word, p in ranked
        if p.value >= LEAST_PROBABILITY
    )
    header = ("word", "what happens", "probability")
    return Table("Probability of being the main cause", header, rows, 2)


def _how_far(found: Node) -> Table:
    sizes = found["gap"]
    folds = [sizes["held_out"], *sizes.get("held_out_other")]
    noise, no = sizes["noise_rms_mm"].number(), NOTHING
    rows = [row("fitted", *_sizes(sizes), no, no)]
    if sizes.get("written_after_rms_mm"):
        rows.append(row("in a model file", *_sizes(sizes, "written_"), no, no))
    for h in folds:
        if h:
            told = h["ci95"][0].value < h["ci95"][1].value
            low, high = (h["ci95"][i].number(3) if told else no for i in (0, 1))
            rows.append(row(f"withheld: {h['fold'].text()}", *_sizes(h), low, high))
    rows.append(row("noise of the instruments", no, noise, no, no, no, no))
    for word, r in found.get("runners_up").items():
        after = r["held_out_after_rms_mm"].number()
        rows.append(row(f"withheld, with {word} alone", no, after, no, no, no, no))
    header = ("", "before mm", "after mm", "after/noise", "shrinks by", "95 % from", "to")
    told = less_datum(h["fold"].text() for h in folds if h and h["own_datum"].value)
    return Table(f"How far the gap shrinks (rms{'; ' * bool(told)}{told})", header, tuple(rows))


def _sizes(node: Node, of: str = "") -> tuple[Rich, Rich, Rich, Rich]:
    """Before, after, that over the noise, and by how much it shrinks. of: begins the keys."""
    before, after = node["before_rms_mm"].number(), node[f"{of}after_rms_mm"].number()
    over, shrinks = node[f"{of}after_over_noise"], node[f"{of}shrink_factor"]
    return before, after, over.number(3), shrinks.number(3)


def _next(found: Node) -> list[Block]:
    following = found["next_measurement"]
    if not following:
        return []
    pair = " from ".join(following.get("separates").value or ())
    words = (f"To tell {pair}: {following['text'].text()}",)
    return [Section("gap-next", "What to measure next", (Paragraph(words),))]


def _noted(found: Node, kind: str) -> list[Block]:
    """The notes of a kind under their heading, if there are any."""
    notes = [(n.text(), k.text()) for n, k in zip(found["notes"], found["note_kinds"], strict=True)]
    told = tuple(text for text, of in notes if of == kind)
    name = f"gap-{kind.replace(' ', '-')}"
    return [Section(name, NOTED[kind], (Bullets(told),))] if told else []
