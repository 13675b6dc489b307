"""The text of an analysis: plain tables that survive a pipe and a mail. Lines are whole; a terminal
folds them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from identification.stiffness import Exclusion, Stiffness
from identification.uncertainty import Quantity
from rig.analysis.analyze import Analysis, Direction
from rig.digits import number
from rig.units import MM_PER_M, N_PER_MM


def text(analysis: Analysis) -> str:
    """Banners, the answer in one sentence, then what it rests on, direction by direction."""
    lines = [*analysis.banners]
    if lines:
        lines.append("")
    lines.append(f"{analysis.name}: {answer(analysis)}")
    lines += [f"Mind: {note}" for note in analysis.notes]
    for key, direction in analysis.directions.items():
        lines += ["", *_direction(key, direction)]
    return "\n".join(lines)


def answer(analysis: Analysis) -> str:
    """The first sentence: every k with its interval, and how they compare."""
    if not analysis.directions:
        return "there are no samples to analyze."
    parts = []
    for key, direction in analysis.directions.items():
        k = direction.result.k
        if k is None:
            parts.append(f"k in {key} is undefined")
        else:
            parts.append(f"k in {key}{_over(direction)} is {_with_interval(k, N_PER_MM)} N/mm")
    for (a, b), ratio in analysis.anisotropy.items():
        parts.append(f"{a} is {_with_interval(ratio)} times as stiff as {b}")
    known = any(d.result.k is not None for d in analysis.directions.values())
    return "; ".join(parts) + (" (in brackets: 95 % intervals)." if known else ".")


def _over(direction: Direction) -> str:
    """The levels, where they are a part of those asked for: k and its interval are theirs alone."""
    levels = direction.levels
    return "" if levels is None or not levels.partial else f" (over {levels.words})"


def _with_interval(q: Quantity, scale: float = 1.0) -> str:
    value = q.value * scale
    low, high = (number(edge * scale, beside=value) for edge in q.interval)
    return f"{number(value)} [{low}, {high}]"


def _direction(key: str, direction: Direction) -> Iterator[str]:
    r = direction.result
    pose = direction.pose
    title = f"Direction {key}"
    if pose and not key.startswith(f"{pose}/"):
        title += f", pose {pose}"
    yield title
    yield "-" * len(title)
    if r.sentence:
        yield r.sentence
    if r.k is not None:
        yield from _stiffness(r, r.k, _over(direction))
    if r.knee is not None:
        before, after = (number(k * N_PER_MM) for k in (r.knee.k_before, r.knee.k_after))
        yield (
            f"Knee at {_with_interval(r.knee.force)} N, "
            f"{_with_interval(r.knee.displacement, MM_PER_M)} mm: the slope falls from {before} "
            f"to {after} N/mm."
        )
    yield from _excluded(r.excluded)
    if r.hysteresis is not None:
        loop = r.hysteresis
        percent = 100 * loop.relative
        share = "" if math.isnan(percent) else f", {percent:.1f} % of the work of loading"
        yield (
            f"Loop between loading and unloading: {number(loop.area * MM_PER_M)} N mm{share}; "
            "k is that of loading."
        )
    yield from r.notes
    yield from _tables(r)


def _stiffness(r: Stiffness, k: Quantity, over: str) -> Iterator[str]:
    value = k.value * N_PER_MM
    low, high = (number(edge * N_PER_MM, beside=value) for edge in k.interval)
    yield (
        f"k{over} = {number(value)} N/mm, standard uncertainty "
        f"{number(k.u * N_PER_MM, 2, value)} N/mm, 95 % from {low} to {high} N/mm"
    )
    yield f"Line: {r.choice.label}; {r.choice_reason}."
    if r.choice.intercept:
        yield f"Intercept: {number(r.intercept * MM_PER_M)} mm"
    if len(r.by_repetition) > 1:
        shown = ", ".join(number(v * N_PER_MM) for v in r.by_repetition[:8])
        more = ", ..." if len(r.by_repetition) > 8 else ""
        yield f"{len(r.by_repetition)} repetitions: {shown}{more} N/mm"


def _excluded(excluded: Sequence[Exclusion]) -> Iterator[str]:
    by_reason: dict[str, list[int]] = {}
    for e in excluded:
        by_reason.setdefault(e.reason, []).append(e.step)
    for reason, steps in by_reason.items():
        word = "step" if len(steps) == 1 else "steps"
        yield f"Not counted: {word} {', '.join(map(str, steps))}: {reason}."


def _tables(r: Stiffness) -> Iterator[str]:
    levels = [
        (
            p.branch,
            str(p.step),
            number(p.force),
            number(p.displacement * MM_PER_M),
            number(p.sd * MM_PER_M, 2),
            str(p.n),
        )
        for p in r.levels
    ]
    yield from _table(
        "Curve (means over the repetitions)",
        ("branch", "step", "force N", "displacement mm", "sd mm", "n"),
        levels,
        words=1,
    )
    pointwise = [
        (number(p.force), number(p.stiffness * N_PER_MM), number(p.sd * N_PER_MM, 2), str(p.n))
        for p in r.pointwise
    ]
    yield from _table(
        "Pointwise stiffness between neighbouring levels",
        ("force N", "k N/mm", "sd N/mm", "n"),
        pointwise,
        words=0,
    )
    budget = [
        (
            c.name if c.counted else f"({c.name})",
            c.kind,
            number(c.u * N_PER_MM, 3),
            "-" if math.isinf(c.dof) else number(c.dof, 1),
        )
        for c in r.budget
    ]
    yield from _table(
        "Uncertainty of k (dof: degrees of freedom; in brackets: within another line)",
        ("contribution", "type", "u N/mm", "dof"),
        budget,
        words=2,
    )
    rivals = [
        (
            _short(a.choice.label)[0],
            "all" if a.after_knee else "as above",
            number(a.value * N_PER_MM),
            number(a.u * N_PER_MM, 2),
        )
        for a in r.alternatives
    ]
    header = ("weighting and origin", "steps", "k N/mm", "u N/mm")
    yield from _table("k under other choices", header, rivals, words=2)
    meanings = dict.fromkeys(_short(a.choice.label)[1] for a in r.alternatives)
    if meanings:
        yield f"  {'; '.join(meanings)}"


def _short(label: str) -> tuple[str, str]:
    """A choice without what its weighting means, for a column; and that meaning."""
    weighting, _, rest = label.partition(" (")
    meaning, _, place = rest.partition(")")
    return weighting + place, f"{weighting}: {meaning}"


def _table(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], words: int
) -> Iterator[str]:
    """The first `words` columns to the left, numbers to the right; nothing without rows."""
    if not rows:
        return
    widths = [max(len(line[i]) for line in (header, *rows)) for i in range(len(header))]
    yield ""
    yield title
    for line in (header, *rows):
        cells = [
            cell.ljust(width) if i < words else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        yield "  " + "  ".join(cells).rstrip()
