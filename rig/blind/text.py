"""A report of `rig blind` in words: plain tables for the terminal, Markdown for the docs.

Both are made of the JSON document alone, so that a stored run can be shown again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rig.blind.campaign import EACH
from rig.blind.targets import Line, lines

Row = tuple[str, ...]
EMULATED = "SIMULATED: every measurement below was drawn by a computer; nothing was measured."


def terminal(report: dict[str, Any]) -> str:
    """What the command prints."""
    parts = [EMULATED, head(report), _table(figures(report["summary"]))]
    for title, rows in breakdowns(report["tables"], report["summary"]):
        if len(rows) > 1:
            parts.append(f"{title}\n{_table(rows)}")
    if report["failures"] or report["undrawn"]:
        parts.append(_failures(report))
    parts.append(f"The same cases again: {report['command']}")
    return "\n\n".join(parts)


def markdown(report: dict[str, Any], level: int = 2) -> str:
    """The same as Markdown tables. level: of the headings."""
    hashes = "#" * level
    parts = [
        EMULATED,
        f"`{report['command']}`",
        head(report),
        _markdown(figures(report["summary"])),
    ]
    for title, rows in breakdowns(report["tables"], report["summary"]):
        if len(rows) > 1:
            parts += [f"{hashes} {title}", _markdown(rows)]
    if report["failures"] or report["undrawn"]:
        parts.append(_failures(report))
    return "\n\n".join(parts)


def head(report: dict[str, Any]) -> str:
    """One or two sentences: what was drawn and how it went."""
    done, asked = report["cases_done"], report["cases_asked"]
    s = report["summary"]
    out = f"{done} cases of the generator {report['generator']}, seed {report['seed']}"
    if report["interrupted"]:
        out += f" (interrupted; {asked} were asked for)"
    if report["word"]:
        out += f", all of {report['word']}"
    if report["withhold"]:
        word = "every word in turn" if report["withhold"] == EACH else report["withhold"]
        out += f", with {word} taken out of the library"
    out += f". Figures count cases whose gap is at least {report['snr_min']:g} times the noise"
    judged = s["right_all_kinds"]
    out += f", and those without a gap: {judged['hits']} of {judged['n']} verdicts are right."
    return out


def figures(summary: dict[str, Any]) -> list[Row]:
    """Header and one row a measure: figure, 95 % interval, cases, aim, whether it is met."""
    rows: list[Row] = [("measure", "figure", "95 % interval", "cases", "aimed at", "met")]
    rows += [_figure(line) for line in lines(summary) if line.value is not None]
    return rows


def _figure(line: Line) -> Row:
    interval = "" if line.low is None else f"{line.low:.2f} to {line.high:.2f}"
    met = {True: "yes", False: "no", None: ""}[line.met]
    cases = "" if line.n is None else f"{line.hits} of {line.n}"
    return line.measure.title, _number(line.value), interval, cases, line.aim, met


def breakdowns(tables: dict[str, Any], summary: dict[str, Any]) -> list[tuple[str, list[Row]]]:
    """Title and rows (the first is the header) of every further table."""
    titles = {
        "by_effect": "One effect, by word",
        "by_snr": "One effect, by size of the gap over the noise (all sizes)",
        "by_laws": "One effect, by law: one that the library fits, or a foreign one",
        "by_design": "One effect, by design of the measurement",
        "by_kind": "By kind of case",
        "by_withheld": "Withheld from the library (right: unknown, or a word that stands in)",
        "by_form": "One effect, by word and law",
    }
    out = [(title, _marks(tables[key])) for key, title in titles.items()]
    out.append(("Verdicts by what the case holds", _confusion(tables["confusion"])))
    out.append(("Reliability of the verdict's probability", _reliability(summary)))
    out.append(("Parameters: intervals that hold the truth", _coverage(tables["coverage"])))
    return out


def _marks(groups: dict[str, Any]) -> list[Row]:
    rows: list[Row] = [("", "cases", "right", "95 % interval", "or in set", "exact", "wrong")]
    for name, marks in groups.items():
        right = marks["right"]
        low, high = right["ci95"]
        wrong = ", ".join(f"{word} {n}" for word, n in marks["wrong_verdicts"].items())
        rows.append(
            (
                name,
                str(right["n"]),
                _number(right["value"]),
                f"{low:.2f} to {high:.2f}",
                _number(marks["right_or_in_set"]["value"]),
                _number(marks["exact"]["value"]),
                wrong,
            )
        )
    return rows


def _confusion(confusion: dict[str, dict[str, int]]) -> list[Row]:
    rows: list[Row] = [("holds", "verdicts")]
    for name, verdicts in confusion.items():
        rows.append((name, ", ".join(f"{word} {n}" for word, n in verdicts.items())))
    return rows


def _reliability(summary: dict[str, Any]) -> list[Row]:
    rows: list[Row] = [("probability", "cases", "mean", "right", "95 % interval")]
    for b in summary["calibration"]["reliability"]:
        low, high = b["ci95"]
        rows.append(
            (
                f"{b['from']:.1f} to {b['to']:.1f}",
                str(b["n"]),
                _number(b["confidence"]),
                _number(b["right"]),
                f"{low:.2f} to {high:.2f}",
            )
        )
    return rows


def _coverage(groups: dict[str, Any]) -> list[Row]:
    rows: list[Row] = [("parameter (laws)", "intervals", "of 95 %", "of 90 %", "value / true")]
    for name, marks in groups.items():
        rows.append(
            (
                name,
                str(marks["in_95"]["n"]),
                _number(marks["in_95"]["value"]),
                _number(marks["in_90"]["value"]),
                _number(marks["median_value_over_true"]),
            )
        )
    return rows


def _failures(report: dict[str, Any]) -> str:
    parts = []
    if report["failures"]:
        rows = [f"  {f['name']}: {f['status']}, {f['reason']}" for f in report["failures"]]
        parts += ["Cases without an answer (counted as wrong)", *rows]
    if report["undrawn"]:
        rows = [f"  number {u['number']}: {u['reason']}" for u in report["undrawn"]]
        parts += ["Cases that could not be drawn (not counted)", *rows]
    return "\n".join(parts)


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return (
        f"{value:.3g}" if abs(value) >= 10 else f"{value:.2f}" if value >= 0.1 else f"{value:.3f}"
    )


def _table(rows: Sequence[Row]) -> str:
    """Columns side by side: the first and the last to the left, numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    last = len(widths) - 1
    out = []
    for row in rows:
        cells = [
            cell.ljust(width) if i in (0, last) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        out.append(("  " + "  ".join(cells)).rstrip())
    return "\n".join(out)


def _markdown(rows: Sequence[Row]) -> str:
    header, *body = rows
    out = ["| " + " | ".join(header) + " |", "| " + " | ".join("---" for _ in header) + " |"]
    out += ["| " + " | ".join(cell or " " for cell in row) + " |" for row in body]
    return "\n".join(out)
