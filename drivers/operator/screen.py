"""What the operator's screen shows, as rich renderables; numbers in, picture out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from rich.align import Align
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from drivers.interfaces import LimitLevel, LiveView, Phase, Prompt
from drivers.operator.fitted import Fitted, Part, Rank

GLYPHS = {
    "0": ("█▀█", "█ █", "█▄█"),
    "1": ("▄█ ", " █ ", "▄█▄"),
    "2": ("▀▀█", "█▀▀", "█▄▄"),
    "3": ("▀▀█", " ▀█", "▄▄█"),
    "4": ("█ █", "▀▀█", "  █"),
    "5": ("█▀▀", "▀▀█", "▄▄█"),
    "6": ("█▀▀", "█▀█", "█▄█"),
    "7": ("▀▀█", "  █", "  █"),
    "8": ("█▀█", "█▀█", "█▄█"),
    "9": ("█▀█", "▀▀█", "▄▄█"),
    "-": ("   ", "▀▀▀", "   "),
    ".": (" ", " ", "▄"),
    "N": ("█▄ █", "█ ▀█", "█  █"),
    " ": (" ", " ", " "),
}
KEYS = "p pause   r redo step   R redo repetition   s skip   a abort"
NO_SAFETY = "Software monitoring is no safety function."
EMULATED = " EMULATED: no real arm, no real measurement "
HANDS_OFF: dict[Phase, str] = {
    "idle": "WAIT",
    "mounting": "SET UP",
    "taring": "HANDS OFF - force is being zeroed",
    "settling": "HANDS OFF - the arm settles",
    "sampling": "HANDS OFF - sampling",
    "zero": "HANDS OFF - zero load",
    "rest": "HANDS OFF - rest",
    "paused": "PAUSED",
}
DIRECTION_COLOURS = {"TIGHTEN": "bold cyan", "LOOSEN": "bold magenta"}
BAR_WIDTH = 61


def large(text: str) -> list[str]:
    """Three lines of block digits; characters without a glyph are left out."""
    glyphs = [GLYPHS[c] for c in text if c in GLYPHS]
    return [" ".join(glyph[row] for glyph in glyphs) for row in range(3)]


@dataclass(frozen=True, slots=True)
class Turning:
    """What the hand should do: `remaining_N` to the target, `turns` of the screw (nan: unknown)."""

    sense: Literal["in", "out", "hold"]
    remaining_N: float
    turns: float


def turning(view: LiveView, pitch_mm: float) -> Turning | None:
    """Which way to turn, and about how far; None while hands are off or there is no force.

    How far follows from the stiffness of the last points and the screw's pitch; without a
    stiffness no number is given.
    """
    if view.phase in HANDS_OFF:
        return None
    if not (math.isfinite(view.force_N) and math.isfinite(view.target_N)):
        return None
    need = view.target_N - view.force_N
    if abs(need) <= view.band_N:
        return Turning("hold", abs(need), 0.0)
    sense = math.copysign(1.0, view.target_N) if view.target_N else math.copysign(1.0, view.force_N)
    known = view.stiffness_N_per_mm > 0
    turns = abs(need) / view.stiffness_N_per_mm / pitch_mm if known else math.nan
    return Turning("in" if need * sense > 0 else "out", abs(need), turns)


def hint(view: LiveView, pitch_mm: float) -> tuple[str, str]:
    """`turning` as a word and how far: ("TIGHTEN", "about 0.4 turns"), ("HOLD", "in the band")."""
    if view.phase in HANDS_OFF:
        return HANDS_OFF[view.phase], ""
    turn = turning(view, pitch_mm)
    if turn is None:
        return "WAIT", "no force to go by"
    if turn.sense == "hold":
        return "HOLD", "in the band"
    far = f"{turn.remaining_N:.1f} N to go"
    if math.isfinite(turn.turns):
        far += f", about {turn.turns:.2f} turns"
    return {"in": "TIGHTEN", "out": "LOOSEN"}[turn.sense], far


def bar(view: LiveView, width: int = BAR_WIDTH) -> Text:
    """Where the force stands between zero and a quarter beyond the target, band marked."""
    text = Text()
    if not (math.isfinite(view.force_N) and math.isfinite(view.target_N)):
        return Text("·" * width, style="dim")
    band = view.band_N if view.band_N > 0 else 0.0  # nan: there is none yet
    top = 1.25 * max(abs(view.target_N), 4 * (band or 1.0), 1.0)
    sense = -1.0 if view.target_N < 0 else 1.0
    scale = (width - 1) / top
    at = round(min(max(sense * view.force_N, 0.0), top) * scale)
    low = round(max(sense * view.target_N - band, 0.0) * scale)
    high = round(min(sense * view.target_N + band, top) * scale)
    inside = abs(view.force_N - view.target_N) <= band
    for column in range(width):
        if column == at:
            text.append("█", style="bold green" if inside else "bold yellow")
        elif low <= column <= high:
            text.append("▒", style="green")
        else:
            text.append("─" if column < at else "·", style="yellow" if column < at else "dim")
    return text


def number(value: float, form: str, unit: str) -> str:
    """A value with its unit, or a dash when there is none."""
    if not math.isfinite(value):
        return f"- {unit}"
    shown = f"{value:{form}}"
    return f"{shown if float(shown) else shown.lstrip('-')} {unit}"


def screen(
    view: LiveView | None,
    *,
    pitch_mm: float,
    age_s: float,
    stale_s: Mapping[str, float],
    notices: Sequence[tuple[str, str]],
    prompt: Prompt | None = None,
    typed: str = "",
    complaint: str = "",
    emulated: bool = False,
) -> RenderableType:
    """The whole screen. `age_s`: of the view; `stale_s`: how long devices have been stale.

    Fits the terminal: the question, where its answer is typed, and what this is not stay longest.
    """

    def parts(width: int) -> list[Part]:
        asked = prompt.key if prompt is not None else None
        return [
            *_live(view, pitch_mm, age_s, stale_s, asked, width),
            *_notices(notices),
            Part(Text(KEYS, style="dim"), Rank.KEYS)
            if prompt is None
            else _question(prompt, typed, complaint),
            Part(Text(NO_SAFETY, style="dim")),
        ]

    mark = Text(EMULATED, style="bold black on yellow") if emulated else None
    return Fitted(parts, _title(view), mark)


def _title(view: LiveView | None) -> str:
    if view is None or not view.direction:
        return "stiffness measurement"
    place = (
        f"pose {view.pose}   direction {view.direction}   "
        f"repetition {view.repetition} of {view.repetitions}"
    )
    return f"{place}   step {view.step} of {view.steps}" if view.step else place


def _live(
    view: LiveView | None,
    pitch_mm: float,
    age_s: float,
    stale_s: Mapping[str, float],
    asked: str | None,
    width: int,
) -> list[Part]:
    if view is None:
        return [Part(Text("waiting for the first values", style="dim"))]
    age_s += max(view.force_age_s, view.displacement_age_s)
    old = age_s > 1.0 or bool(stale_s)
    style = "grey42" if old else "bold white"
    force = f"{view.force_N:.1f} N" if math.isfinite(view.force_N) else "--- N"
    word, far = hint(view, pitch_mm)
    idle = asked == "mount" and not stale_s  # nothing is loaded, and no value looked at
    if idle:
        word, far = "SET UP", "as the question below says"
    elif old:
        word, far = "STOP", "values are old"
    elif asked == "unload":
        word, far = "LOOSEN", "until the force no longer answers"
        if not math.isfinite(view.force_N):  # before the first tare
            far = "until the screw no longer touches"
    elif asked is not None:
        word, far = "HANDS OFF", "the question below first"
    arrow = {"TIGHTEN": "▶▶ ", "LOOSEN": "◀◀ "}.get(word, "")
    colour = DIRECTION_COLOURS.get(word, "bold green" if word == "HOLD" else "bold")
    target = f"target {number(view.target_N, '.1f', 'N')}"
    if view.band_N > 0:
        target += f" ± {number(view.band_N, '.2g', 'N')}"
    digits = Group(*(Align.center(Text(line, style=style)) for line in large(force)))
    blank = Part(Text(), Rank.BLANK)
    parts = [
        blank,
        Part(digits, Rank.DIGITS, instead=Align.center(Text(force, style=style))),
        blank,
        Part(Align.center(bar(view, min(BAR_WIDTH, width))), Rank.BAR),
        Part(Align.center(Text(target)), Rank.TARGET),
        blank,
        Part(
            Align.center(Text(f"{arrow}{word}", style="bold red" if old and not idle else colour))
        ),
        Part(Align.center(Text(far))) if far else blank,
        blank,
        Part(_facts(view, style), Rank.FACTS),
        *_limits(view),
    ]
    for device, seconds in stale_s.items():
        parts.append(Part(Text(f"{device}: no fresh value for {seconds:.1f} s", style="bold red")))
    if age_s > 1.0 and not idle:
        parts.append(Part(Text(f"the values are {age_s:.0f} s old", style="bold red")))
    if view.message:
        parts.append(Part(Text(view.message, style="yellow")))
    return parts


def _facts(view: LiveView, style: str) -> Table:
    table = Table.grid(padding=(0, 3), expand=True)
    for _ in range(4):
        table.add_column(justify="center")
    settling = f"{view.settle_remaining_s:.0f} s" if view.phase == "settling" else "-"
    table.add_row("displacement", "phase", "settling", "samples", style="dim")
    table.add_row(
        number(view.displacement_mm, ".3f", "mm"),
        view.phase,
        settling,
        f"{view.samples} of {view.samples_wanted}",
        style=style,
    )
    return table


def _limits(view: LiveView) -> list[Part]:
    """How much is left of each limit, the closest first; none while nothing is watched."""
    watched = [v for v in view.limits if v.limit > 0 and math.isfinite(v.value)]
    if not watched:
        return []
    line = Text("left of the limits: ", style="dim")
    # By what is shown: else equal ones would change places all the time.
    for level in sorted(watched, key=_percent_left):
        left = 1.0 - level.value / level.limit
        style = "bold red" if left < 0.1 else "yellow" if left < 0.25 else "dim"
        line.append(f"{level.quantity} {_percent_left(level)} %   ", style=style)
    return [Part(line, Rank.LIMITS)]


def _percent_left(level: LimitLevel) -> int:
    return round(100 * (1.0 - level.value / level.limit))


def _notices(notices: Sequence[tuple[str, str]]) -> list[Part]:
    colours = {"warning": "yellow", "error": "bold red"}
    texts = [Text(text, style=colours.get(level, "dim")) for level, text in notices]
    older = [Part(text, Rank.OLDER_NOTICE) for text in texts[:-1]]
    return older + [Part(text, Rank.NEWEST_NOTICE) for text in texts[-1:]]


def _question(prompt: Prompt, typed: str, complaint: str) -> Part:
    text = Text(prompt.text + "\n", style="bold")
    if len(prompt.answers) == 1:
        text.append("Press Enter: ", style="cyan")  # alone it confirms where nothing is to choose
    elif prompt.answers:
        text.append("Type " + " / ".join(prompt.answers), style="cyan")
        text.append(" (or its beginning) and Enter: ", style="dim")
    else:
        text.append("Type and Enter: ", style="dim")
    text.append(typed + "▏")
    if complaint:
        text.append(f"\n{complaint}", style="red")
    return Part(Panel(text, border_style="cyan"), Rank.FRAME, instead=text)


def plain(view: LiveView, pitch_mm: float) -> str:
    """One line for outputs that are no terminal."""
    word, far = hint(view, pitch_mm)
    stale = f" STALE: {', '.join(view.stale)}" if view.stale else ""
    return (
        f"{view.direction} {view.repetition}/{view.repetitions} step {view.step}/{view.steps} "
        f"{view.phase}: {number(view.force_N, '.1f', 'N')} of {number(view.target_N, '.1f', 'N')}, "
        f"{number(view.displacement_mm, '.3f', 'mm')} - {word}{', ' + far if far else ''}{stale}"
    )
