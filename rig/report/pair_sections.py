"""The chapters on several things at once: two coupled arms, and several data sets side by side."""

from __future__ import annotations

from collections.abc import Sequence

from rig.report.compare import aligned
from rig.report.document import (
    Block,
    Bullets,
    Facts,
    Paragraph,
    Rich,
    Row,
    Section,
    Table,
    Word,
    row,
)
from rig.report.gather import Gathered, Session
from rig.report.pictures import Pictures
from rig.report.results import NOTHING, Node, quantity
from rig.units import KNM


def coupling(gathered: Gathered, data: Node, pictures: Pictures) -> Section:
    """One arm and two coupled arms."""
    kinds = [("single", data["single_N_per_mm"], data["single_standard_uncertainty_N_per_mm"])]
    kinds += [
        (f"coupled, {name}", k, data["coupled_standard_uncertainty_N_per_mm"][name])
        for name, k in data["coupled_N_per_mm"].items()
        if k
    ]
    rows = tuple(
        row(name, *(cell for a in "xyz" for cell in (k[a].number(), u[a].number(2))))
        for name, k, u in kinds
    )
    gains = tuple(
        row(name, *(g[a].number(3) for a in "xyz")) for name, g in data["gain"].items() if g
    )
    blocks: list[Block] = [
        Facts(
            (
                ("Model", data["model"].text()),
                ("Coupling", data["kind"].text()),
                ("Coupled loads along", f"{data['load_axes'].text()} axes"),
            )
        ),
        pictures.coupling(gathered),
        Table(
            "Stiffness in N/mm, with standard uncertainties",
            ("state", "x", "u", "y", "u", "z", "u"),
            rows,
        ),
        Table("How many times stiffer than one arm", ("coupling", "x", "y", "z"), gains),
        _workspace(data),
        *_decisions(data),
        *_published(data),
        *_bullets(data["notes"]),
    ]
    return Section("coupling", "Two coupled arms", tuple(blocks), _coupling_banners(gathered))


def _coupling_banners(gathered: Gathered) -> tuple[str, ...]:
    words = {
        "EMULATED": "EMULATED: the model was identified from simulated devices.",
        "INCOMPLETE": "INCOMPLETE: the model was identified from an incomplete measurement.",
    }
    return tuple(words[mark] for mark in gathered.coupling_marks)


def _workspace(data: Node) -> Table:
    volumes = [data["workspace_m3"], *data["workspace_others_m3"]]
    rows = tuple(
        (w["definition"].text(), w["single"].number(), w["coupled"].number(), w["ratio"].percent(4))
        for w in volumes
    )
    return Table("Workspace", ("definition", "single m³", "coupled m³", "ratio"), rows)


def _decisions(data: Node) -> list[Block]:
    rows = tuple(
        (d["direction"].text(), d["state"].text(), d["required_N_per_mm"].number())
        for d in data["decision"]
    )
    header = ("direction", "state", "required N/mm")
    return [Table("When to couple", header, rows, 2)] if rows else []


def _published(data: Node) -> list[Block]:
    rows = tuple(
        (
            r["quantity"].text(),
            r["unit"].text(),
            r["stated"].number(),
            r["follows"].number(),
            r["model"].number(),
        )
        for r in data["published"]
    )
    if not rows:
        return []
    caption = "Published (doi 10.3390/jmmp10020054) beside this model; shown, never judged by"
    return [Table(caption, ("quantity", "unit", "stated", "follows", "this model"), rows, 2)]


def _bullets(notes: Node) -> list[Block]:
    return [Bullets(tuple(n.text() for n in notes))] if notes else []


def comparison(gathered: Gathered, data: Node, pictures: Pictures) -> Section:
    """Several data sets side by side, and whether they differ."""
    sessions = gathered.sessions
    blocks: list[Block] = [_overview(sessions, data)]
    pairs, unlike = list(data["comparison"]), list(data["not_compared"])
    if pairs or unlike:
        blocks.append(_in_words(gathered, pairs, unlike))
    if pairs:
        blocks += [
            _tested(gathered, pairs),
            *_remarks(gathered, pairs),
            *_how_tested(pairs),
        ]
    elif not unlike:
        words = "No pose and direction has a stiffness in the first data set and in another one."
        blocks.append(Paragraph((words,), "warning"))
    blocks += pictures.compared(gathered)
    with_joints = [s for s in sessions if s.joints is not None]
    if len(with_joints) > 1:
        blocks += [pictures.joints(with_joints), _compared_joints(gathered, data)]
    return Section("comparison", "Side by side", tuple(blocks), gathered.banners)


def _overview(sessions: Sequence[Session], data: Node) -> Table:
    names = aligned([s.analysis for s in sessions])
    rows: list[Row] = []
    for i, (session, one) in enumerate(zip(sessions, data["datasets"], strict=True)):
        found = one["analyze"]["directions"]
        keys = [each[i] for each in names.values()]
        cells = [
            (NOTHING,) if k is None else quantity(found[k]["stiffness_N_per_mm"]) for k in keys
        ]
        verdict = one["diagnose"]["verdict"].text() if one["diagnose"] else NOTHING
        state = Word("complete", "good") if session.dataset.complete else Word("incomplete", "bad")
        where = one["created"].text()[:10]
        rows.append(row(session.label, where, one["origin"].text(), state, verdict, *cells))
    header = ("data set", "date", "origin", "state", "verdict", *(f"k in {n} N/mm" for n in names))
    return Table("The data sets", header, tuple(rows), 5)


def _in_words(gathered: Gathered, pairs: Sequence[Node], unlike: Sequence[Node]) -> Block:
    """What the tests found, one sentence a comparison, and what could not be tested."""
    tested = [_sentence(gathered, p) for p in pairs]
    return Bullets((*tested, *(_no_sentence(gathered, u) for u in unlike)))


def _no_sentence(gathered: Gathered, unlike: Node) -> Rich:
    first, second = (gathered.sessions[unlike[side].value].label for side in ("first", "second"))
    head = f"Direction {unlike['direction'].text()}: "
    told = Word(f"{second} and {first} are not compared", "strong")
    return (head, told, f": {unlike['reason'].text()}.")


def _sentence(gathered: Gathered, pair: Node) -> Rich:
    first, second = (gathered.sessions[pair[side].value].label for side in ("first", "second"))
    ratio, low, high = pair["ratio"]["value"], *pair["ratio"]["ci95"]
    shown = (*ratio.number(), " times as stiff as ", first)
    within = (" (95 %: ", *low.number(), " to ", *high.number(), " times)")
    head: Rich = (f"Direction {pair['direction'].text()}: ",)
    if pair["force_N"]:
        low_N, high_N = (edge.number(3) for edge in pair["force_N"])
        head = (f"Direction {pair['direction'].text()}, from ", *low_N, " to ", *high_N, " N: ")
    if pair["differs"].value:
        word = "stiffer" if pair["difference_N_per_mm"]["value"].value > 0 else "softer"
        return (*head, Word(f"{second} is {word}", "strong"), ", ", *shown, *within, ".")
    return (*head, "no difference is shown; ", second, " is ", *shown, *within, ".")


def _tested(gathered: Gathered, pairs: Sequence[Node]) -> Table:
    rows = tuple(
        (
            p["direction"].text(),
            gathered.sessions[p["second"].value].label,
            Word("differs", "bad") if p["differs"].value else Word("no difference shown", "open"),
            p["difference_N_per_mm"]["value"].number(),
            p["difference_N_per_mm"]["ci95"][0].number(),
            p["difference_N_per_mm"]["ci95"][1].number(),
            p["ratio"]["value"].number(),
            p["ratio"]["ci95"][0].number(),
            p["ratio"]["ci95"][1].number(),
            p["p"].chance(),
            p["p_adjusted"].chance(),
        )
        for p in pairs
    )
    header = (
        "direction",
        "data set",
        "k against the first",
        "difference N/mm",
        "95 % from",
        "to",
        "ratio",
        "95 % from",
        "to",
        "p",
        "p adjusted",
    )
    caption = (
        f"Difference of k to {gathered.sessions[0].label}, at 5 % for all comparisons together"
    )
    return Table(caption, header, rows, 3)


def _remarks(gathered: Gathered, pairs: Sequence[Node]) -> list[Block]:
    items = tuple(
        f"{p['direction'].text()}, {gathered.sessions[p['second'].value].label}: {r.text()}."
        for p in pairs
        for r in p["remarks"]
    )
    return [Bullets(items)] if items else []


def _how_tested(pairs: Sequence[Node]) -> list[Block]:
    shared = [p["same_instruments"].value for p in pairs]
    gains = (
        "the gains cancel, since the instruments are the same"
        if all(shared)
        else "the gains count on both sides, since the instruments are not known to be the same"
        if not any(shared)
        else "the gains cancel where the instruments are the same"
    )
    words = (
        f"Student's t on the scatter between repetitions (Welch-Satterthwaite); {gains}; p "
        "adjusted after Holm. Mounting arm or instruments anew is not in the scatter of one "
        "session: a difference shown here may be the mounting's. No difference shown does not mean "
        "equal: the interval says how large a difference may still be."
    )
    return [Paragraph((words,), "note")]


def _compared_joints(gathered: Gathered, data: Node) -> Table:
    columns = [
        (s.label, one["identify"]["joint_stiffness_Nm_per_rad"])
        for s, one in zip(gathered.sessions, data["datasets"], strict=True)
        if one["identify"]
    ]
    rows = tuple(
        row(f"joint {j + 1}", *(quantity(found[j], KNM) for _, found in columns)) for j in range(6)
    )
    return Table("Joint stiffness in kNm/rad", ("", *(label for label, _ in columns)), rows)
