"""The chapters on stiffness and joints."""

from __future__ import annotations

from collections.abc import Iterator

from rig.analysis.identify_text import data_say
from rig.report.document import (
    Block,
    Bullets,
    Cell,
    Facts,
    Inline,
    Paragraph,
    Rich,
    Section,
    Style,
    Table,
    Word,
    row,
)
from rig.report.gather import Session
from rig.report.pictures import Pictures
from rig.report.results import DEGREES, NOTHING, Node, quantity
from rig.units import KNM


def stiffness(session: Session, data: Node, pictures: Pictures) -> Section:
    """Curves, pointwise stiffness, and k with its budget, direction by direction."""
    analyzed = data["analyze"]
    blocks: list[Block] = []
    if not analyzed["directions"]:
        blocks.append(Paragraph(("There are no samples to analyze.",), "warning"))
    else:
        blocks += [*pictures.curves(session), *pictures.pointwise(session)]
    for i, (key, d) in enumerate(analyzed["directions"].items(), start=1):
        blocks.append(Section(f"stiffness-{i}", f"Direction {key}", tuple(_direction(d))))
    return Section("stiffness", "Stiffness", tuple(blocks), session.dataset.banners())


def _direction(d: Node) -> Iterator[Block]:
    k = d["stiffness_N_per_mm"]
    if k["value"].value is None:
        yield Paragraph((d["status_text"].text(),), "warning")
    else:
        u = k["standard_uncertainty"].number(2, unit="N/mm")
        yield Paragraph(
            (
                "k = ",
                *k["value"].number(unit="N/mm"),
                ", standard uncertainty ",
                *u,
                ", 95 % from ",
                *k["ci95"].interval(),
                " N/mm.",
            ),
            "answer",
        )
        if d["status_text"].value:
            yield Paragraph((d["status_text"].text(),), "warning")
        yield Facts(tuple(_line(d)))
    notes = tuple(note.text() for note in d["notes"])
    if notes:
        yield Bullets(notes)
    yield from _stiffness_tables(d)


def _line(d: Node) -> Iterator[tuple[str, Cell]]:
    yield "Line", f"{d['weighting'].text()}; {d['weighting_reason'].text()}"
    if d["intercept_mm"].value:
        yield "Intercept", d["intercept_mm"].number(unit="mm")
    each = list(d["by_repetition_N_per_mm"])
    if len(each) > 1:
        cells: list[Inline] = []
        for node in each[:8]:
            cells += [*node.number(), ", "]
        more = (" and more",) if len(each) > 8 else ()
        yield "Repetitions", (*cells[:-1], *more, " N/mm")
    knee = d["knee"]
    if knee:
        before, after = knee["slope_before_N_per_mm"], knee["slope_after_N_per_mm"]
        yield (
            "Knee",
            (
                "at ",
                *quantity(knee["force_N"]),
                " N, ",
                *quantity(knee["displacement_mm"]),
                " mm; the slope falls from ",
                *before.number(),
                " to ",
                *after.number(),
                " N/mm",
            ),
        )
    loop = d["hysteresis"]
    if loop:
        share = loop["share_of_work"]
        words = (", ", *share.percent(), " of the work of loading") if share else ()
        yield "Loop", (*loop["area_N_mm"].number(3, unit="N mm"), *words)


def _stiffness_tables(d: Node) -> Iterator[Table]:
    budget = tuple(
        (
            c["name"].text() if c["counted"].value else f"({c['name'].text()})",
            c["type"].text(),
            c["standard_uncertainty_N_per_mm"].number(3),
            c["degrees_of_freedom"].number(2),
        )
        for c in d["budget"]
    )
    if budget:
        columns = ("contribution", "type", "u N/mm", "degrees of freedom")
        caption = "Uncertainty of k (in brackets: contained in another line)"
        yield Table(caption, columns, budget, 2)
    curve = tuple(
        (
            p["branch"].text(),
            str(p["step"].value),
            p["force_N"].number(),
            p["displacement_mm"].number(),
            p["sd_mm"].number(2),
            p["n"].number(),
        )
        for p in d["curve"]
    )
    if curve:
        header = ("branch", "step", "force N", "displacement mm", "sd mm", "n")
        yield Table("Curve: means over the repetitions", header, curve, 2)
    pointwise = tuple(
        (
            p["force_N"].number(),
            p["stiffness_N_per_mm"].number(),
            p["sd_N_per_mm"].number(2),
            p["n"].number(),
        )
        for p in d["pointwise"]
    )
    if pointwise:
        yield Table(
            "Pointwise stiffness between neighbouring levels",
            ("force N", "k N/mm", "sd N/mm", "n"),
            pointwise,
            0,
        )
    rivals = tuple(
        (
            a["weighting"].text(),
            a["steps"].text(),
            a["stiffness_N_per_mm"].number(),
            a["standard_uncertainty_N_per_mm"].number(2),
        )
        for a in d["alternatives"]
    )
    if rivals:
        yield Table(
            "k under other choices",
            ("weighting and origin", "steps", "k N/mm", "u N/mm"),
            rivals,
            2,
        )


def joints(session: Session, data: Node, pictures: Pictures) -> Section:
    """Six torsional stiffnesses: what is measured, what repeats the prior, what to measure next."""
    banners, found = session.dataset.banners(), data["identify"]
    if not found:
        reason = data["missing"]["identify"].text()
        return Section("joints", "Joints", (Paragraph((reason,), "warning"),), banners)
    condition = found["condition_number"]
    size = ("condition number ", *condition.number(3)) if condition else ("singular",)
    free = found["null_dimension"]
    blocks: list[Block] = [
        Paragraph(
            (
                "These data determine ",
                *found["rank"].number(),
                " of 6 combinations of springs; ",
                *free.number(),
                " stays" if free.value == 1 else " stay",
                " free (",
                *size,
                ").",
            ),
            "answer",
        ),
        pictures.joints([session]),
        _joint_table(found),
        Paragraph(("Prior: ", found["prior"]["source"].text(), "."), "note"),
    ]
    notes = tuple(n.text() for n in found["notes"])
    blocks += [Bullets(notes)] if notes else []
    blocks += _next_poses(found)
    return Section("joints", "Joints", tuple(blocks), banners)


def _joint_table(found: Node) -> Table:
    rows = tuple(
        (
            str(j + 1),
            _verdict(found["identified"][j].value, found["share_of_data"][j].value),
            q["value"].number(scale=KNM),
            q["standard_uncertainty"].number(2, KNM),
            q["ci95"][0].number(scale=KNM),
            q["ci95"][1].number(scale=KNM),
            found["share_of_data"][j].percent(),
            _bound(found["lower_bound_Nm_per_rad"][j]),
        )
        for j, q in enumerate(found["joint_stiffness_Nm_per_rad"])
    )
    header = (
        "joint",
        "what the data say",
        "kNm/rad",
        "u",
        "95 % from",
        "to",
        "from data",
        "at least",
    )
    return Table("Torsional stiffness in kNm/rad", header, rows, words=2)


def _bound(node: Node) -> Rich:
    """A joint that no load turns has a bound of nothing."""
    return node.number(3, KNM) if node.value > 1 else (NOTHING,)


def _verdict(identified: bool, share: float) -> Word:
    """As `rig identify` has it."""
    style: Style = "good" if identified else "bad" if share < 0.1 else "open"
    return Word(data_say(identified, 100 * share), style)


def _next_poses(found: Node) -> list[Block]:
    rows = tuple(
        row(
            p["why"].text(),
            *(q.number(5, DEGREES) for q in p["q_rad"]),
            *(v.stated() for v in p["direction"]),
            p["force_N"].number(),
        )
        for p in found["next_poses"]
    )
    header = ("why", *(f"q{j} deg" for j in range(1, 7)), "x", "y", "z", "to N")
    caption = "Next poses and directions that would tell most, in this order"
    return [Table(caption, header, rows)] if rows else []
