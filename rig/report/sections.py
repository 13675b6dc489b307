"""The chapters that frame a report: in short, data quality, provenance."""

from __future__ import annotations

from rig.diagnosis.diagnose_text import DOUBTED, NOTED
from rig.digits import counted
from rig.report.document import (
    Block,
    Bullets,
    Cell,
    Facts,
    Inline,
    Paragraph,
    Rich,
    Section,
    Table,
    Word,
)
from rig.report.figures import small_mm
from rig.report.gather import Session
from rig.report.pictures import Pictures
from rig.report.results import NOTHING, Node, quantity

_CHECKED = {
    "file": "the checksums of all columns and texts, when it was read",
    "journal": "the checksum of every record, when it was read",
}


def in_short(session: Session, data: Node) -> Section:
    """The answers first."""
    rows: list[tuple[str, Cell]] = []
    for key, d in data["analyze"]["directions"].items():
        rows.append((f"Stiffness along {key}", (*quantity(d["stiffness_N_per_mm"]), *_k_unit(d))))
        knee = d["knee"]
        if knee:
            rows.append((f"Knee along {key}", (*quantity(knee["force_N"]), " N")))
    for a, b in session.analysis.anisotropy:
        ratio = data["analyze"]["anisotropy"][f"{a}/{b}"]
        rows.append((f"{a} over {b}", (*quantity(ratio), " times as stiff")))
    rows.append(("Joints", _joints(data)))
    rows.append(("Gap to the simulation", _gap(data)))
    rows.append(("Data", _data(session, data)))
    rows += [("Mind", note.text()) for note in data["analyze"]["notes"]]
    note = Paragraph(("In brackets: 95 % intervals.",), "note")
    return Section("short", "In short", (Facts(tuple(rows)), note), session.dataset.banners())


def _k_unit(d: Node) -> Rich:
    if d["stiffness_N_per_mm"]["value"].value is None:
        return (": ", d["status_text"].text())
    everywhere = len({e["step"].value for e in d["excluded"] if e["repetition"].value is None})
    single = {e["repetition"].value for e in d["excluded"]} - {None}
    part = d["levels"]["partial"].value
    words = ["over a part of the range"] * bool(part)
    words += [f"{counted(everywhere, 'step')} not counted"] * bool(everywhere)
    words += [f"repetition {r} not counted in full" for r in sorted(single)]
    return (f" N/mm ({', '.join(words)})" if words else " N/mm",)


def _joints(data: Node) -> Cell:
    found = data["identify"]
    if not found:
        return data["missing"]["identify"].text()
    known = [str(j) for j, ok in enumerate(found["identified"].value, start=1) if ok]
    words = f"identified: {', '.join(known)}" if known else "none identified to 5 %"
    return (f"{words}; rank ", *found["rank"].number(), " of 6")


def _gap(data: Node) -> Cell:
    found = data["diagnose"]
    if not found:
        return data["missing"]["diagnose"].text()
    verdict = found["verdict"].text()
    p = found["probabilities"][verdict].probability()
    words: Rich = (Word(verdict, "strong"), " (probability ", *p, ")")
    held = found["gap"]["held_out"]
    if verdict not in ("none", "unknown") and held:
        low, high = (edge.number(3) for edge in held["ci95"])
        shrinks = (*held["shrink_factor"].number(3), " [", *low, ", ", *high, "] times")
        meaning = f", {found['meanings'][verdict].text()}"
        words = (*words, meaning, "; with it the gap shrinks ", *shrinks, " on withheld data")
    doubts = zip(found["notes"], found["note_kinds"], strict=True)
    first = next((n.text() for n, kind in doubts if kind.text() == DOUBTED), None)
    return words if first is None else (*words, ". ", Word(NOTED[DOUBTED], "strong"), f": {first}")


def _data(session: Session, data: Node) -> Rich:
    quality = data["quality"]
    parts: list[Inline] = [*quality["used"].number(), " of ", *quality["samples"].number()]
    parts.append(" samples in use; ")
    complete = session.dataset.complete
    parts.append(Word("complete", "good") if complete else Word("incomplete", "bad"))
    return tuple(parts)


def data_quality(session: Session, data: Node, pictures: Pictures) -> Section:
    """Punctuality, invalid values, drift, what was left out and why."""
    q = data["quality"]
    rows: list[tuple[str, Cell]] = [
        ("Samples", q["samples"].number()),
        ("Discarded", q["discarded"].number()),
        ("Slots late by", _lateness(q["lateness_s"])),
        ("Slots missed", _count(q["slots_missed"])),
        ("Levels that never settled", _count(q["unsettled_levels"])),
    ]
    if q["clock"].value is not None:
        told = f"{q['clock'].text()}; late slots are late by that much more"
        rows.append(("Clock of the emulated station", (told,)))
    drift = q["force_zero"]
    if drift:
        parts = ("at most ", *drift["largest_change_N"].number(3, unit="N"), " within a run, ")
        rate = drift["largest_drift_N_per_min"].number(3, unit="N/min")
        rows.append(("Force at zero load moves by", (*parts, *rate)))
    for zero in q["displacement_zero"]:
        where = " ".join(filter(None, (zero["pose"].value, zero["direction"].text())))
        unit, scale = small_mm(zero["apart_mm"].value)
        apart = zero["apart_mm"].number(3, scale, unit)
        rows.append((f"Unloaded positions, {where}", (*apart, " apart over the repetitions")))
    blocks: list[Block] = [Facts(tuple(rows)), *_per_device(q)]
    figure = pictures.quality(session)
    if figure is not None:
        blocks.append(figure)
    blocks += [*_left_out(data), *_events(q)]
    return Section("quality", "Data quality", tuple(blocks), session.dataset.banners())


def _count(node: Node) -> Rich:
    return ("not recorded",) if node.value is None else node.number()


def _lateness(node: Node) -> Rich:
    if not node:
        return ("not recorded",)
    median, p95, top = (node[k].number(3, 1e3) for k in ("median", "p95", "max"))
    return (*median, " ms (median), ", *p95, " ms (95 %), ", *top, " ms (most)")


def _per_device(q: Node) -> list[Block]:
    rows = tuple(
        (
            d["name"].text(),
            d["values"].number(),
            d["invalid"].number(),
            d["samples_without_value"].number(),
            d["oldest_value_s"].number(3),
        )
        for d in q["devices"]
    )
    header = ("device", "valid values", "invalid", "samples without", "oldest value s")
    return [Table("Single values behind the samples", header, rows)] if rows else []


def _left_out(data: Node) -> list[Block]:
    """Levels that do not count towards k, and samples that were discarded, with the reason."""
    by_reason: dict[tuple[str, str], list[str]] = {}
    for key, d in data["analyze"]["directions"].items():
        for e in d["excluded"]:
            by_reason.setdefault((key, e["reason"].text()), []).append(str(e["step"].value))
    rows: list[tuple[Cell, ...]] = [
        (f"{key}: step {', '.join(steps)}", "not counted towards k", reason)
        for (key, reason), steps in by_reason.items()
    ]
    rows += [
        ((*d["samples"].number(), " samples"), "discarded", d["reason"].text())
        for d in data["quality"]["discards"]
    ]
    if not rows:
        return [Paragraph(("Nothing was excluded or discarded.",))]
    return [Table("Left out, and why", ("what", "how", "why"), tuple(rows), words=3)]


def _events(q: Node) -> list[Block]:
    items = tuple(
        (*e["session_s"].number(4, unit="s"), ": ", e["text"].text())
        if e["session_s"].value is not None
        else e["text"].text()
        for e in q["events"]
    )
    return [Paragraph(("What happened beside the plan:",)), Bullets(items)] if items else []


def provenance(session: Session, data: Node, made: str, software: str) -> Section:
    """Where all of this comes from."""
    diagnosed = session.diagnosed.json is not None
    commands = ["rig analyze", "rig identify", *(["rig diagnose"] if diagnosed else [])]
    rows: list[tuple[str, Cell]] = [
        ("File", Word(data["file"].text(), "code")),
        (f"SHA-256 of the {data['sha256_of'].text()}", Word(data["sha256"].text(), "code")),
        ("Checked", _CHECKED[data["sha256_of"].text()]),
        ("UUID", Word(data["uuid"].text(), "code")),
        ("Written by", data["software"].text()),
        ("Evaluated by", software),
        ("Page made", made or NOTHING),
        ("The same numbers", f"{', '.join(commands)} with --json, rig report --json"),
    ]
    return Section("provenance", "Provenance", (Facts(tuple(rows)),), session.dataset.banners())
