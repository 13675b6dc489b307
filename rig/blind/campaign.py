"""A campaign: cases are drawn, diagnosed elsewhere, and only then compared with their answers."""

from __future__ import annotations

import queue
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.blind.case import Case, Draw, write_dataset
from rig.blind.diagnosers import Diagnoser, Reply
from rig.errors import InputError, did_you_mean
from rig.terminal import Progress, silent

EACH = "each"  # --withhold: every word in turn


@dataclass(frozen=True)
class Plan:
    """What is drawn and how it is diagnosed.

    word: the effect that every case holds, alone; "" for a draw of all.
    withhold: "" for the complete library, a word, or "each". Then every second case holds the
    withheld word, so that the right answer is `unknown`; the others are drawn as ever. With a word
    to be drawn, all hold that.
    """

    cases: int
    seed: int
    word: str = ""
    withhold: str = ""
    jobs: int = 1
    deadline_s: float = 120.0
    generator: str = "hidden"
    snr_min: float = 3.0

    def withheld(self, number: int, words: Sequence[str]) -> str | None:
        """The word that is out of the library in this case."""
        if not self.withhold:
            return None
        return words[number // 2 % len(words)] if self.withhold == EACH else self.withhold

    def drawn(self, number: int, words: Sequence[str]) -> str | None:
        """The word that this case must hold; None: as the draw likes."""
        if self.word:
            return self.word
        return self.withheld(number, words) if number % 2 == 0 else None

    @property
    def command(self) -> str:
        """The command that gives the same cases again."""
        parts = [f"rig blind --cases {self.cases} --seed {self.seed}"]
        if self.word:
            parts.append(f"--word {self.word}")
        if self.withhold:
            parts.append(f"--withhold {self.withhold}")
        if self.generator != "hidden":
            parts.append(f"--generator {self.generator}")
        if self.snr_min != 3.0:
            parts.append(f"--snr-min {self.snr_min:g}")
        return " ".join(parts)


@dataclass(frozen=True, eq=False)
class Outcome:
    """One case with its answers and what the diagnosis said of it."""

    number: int
    name: str
    label: dict[str, Any]
    withheld: str | None
    reply: Reply


@dataclass(eq=False)
class Campaign:
    """What was diagnosed, in the order of the draw; interrupted: the rest was not.

    undrawn: number and reason of cases that the generator could not make; they are not scored.
    """

    plan: Plan
    outcomes: list[Outcome] = field(default_factory=list)
    undrawn: list[tuple[int, str]] = field(default_factory=list)
    interrupted: bool = False


def run(
    plan: Plan,
    draw: Draw,
    words: Sequence[str],
    *,
    keep: Path | None = None,
    progress: Progress | None = None,
    diagnoser: Callable[[], Diagnoser] | None = None,
) -> Campaign:
    """Runs the plan. words: those the generator can draw; keep: a folder for the data sets.

    Ctrl-C ends it early: what was diagnosed is returned, marked as interrupted. InputError for a
    word that can't be withheld, or a folder that refuses.
    """
    check_plan(plan, words)
    make = diagnoser or (lambda: Diagnoser(plan.deadline_s))
    with _folder(keep) as folder, _Pool(plan.jobs, make) as pool:
        sweep = _Sweep(plan, draw, words, folder, pool, progress or silent)
        try:
            sweep.go()
        except KeyboardInterrupt:
            sweep.campaign.interrupted = True
    sweep.campaign.outcomes.sort(key=lambda o: o.number)
    return sweep.campaign


def check_plan(plan: Plan, words: Sequence[str]) -> None:
    """InputError for what can't be done."""
    for option, word, known in (
        ("--word", plan.word, words),
        ("--withhold", plan.withhold, (*words, EACH)),
    ):
        if word and word not in known:
            raise InputError(
                f'{option}: "{word}" is not drawn by the generator {plan.generator}.'
                f"{did_you_mean(word, known)}"
            )


@contextmanager
def _folder(keep: Path | None) -> Iterator[Path]:
    """The folder given, which must be new or empty, or one that is removed afterwards."""
    if keep is None:
        with tempfile.TemporaryDirectory(prefix="rig-blind-") as name:
            yield Path(name)
        return
    try:
        keep.mkdir(parents=True, exist_ok=True)
        taken = next(keep.iterdir(), None)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{keep}: can't be used: {reason}. Choose another folder.") from error
    if taken is not None:
        raise InputError(f"{keep}: holds {taken.name} already. Give --keep a new folder.")
    yield keep


class _Sweep:
    """One walk over the cases: draws ahead of the diagnosis, but not far."""

    def __init__(
        self,
        plan: Plan,
        draw: Draw,
        words: Sequence[str],
        folder: Path,
        pool: _Pool,
        progress: Progress,
    ) -> None:
        self.campaign = Campaign(plan)
        self._plan, self._draw, self._words = plan, draw, words
        self._folder, self._pool, self._tell = folder, pool, progress
        self._pending: dict[Future[Reply], tuple[int, Case, str | None]] = {}

    def go(self) -> None:
        for number in range(self._plan.cases):
            self._submit(number)
            while len(self._pending) > 2 * self._plan.jobs:
                self._collect()
        while self._pending:
            self._collect()

    def _submit(self, number: int) -> None:
        withheld = self._plan.withheld(number, self._words)
        word = self._plan.drawn(number, self._words)
        try:
            case = self._draw(self._plan.seed, number, word=word)
        except InputError as error:  # no such case of a physical size
            self.campaign.undrawn.append((number, str(error)))
            return
        path = self._folder / f"{number:04d}.h5"  # says nothing of seed or word
        write_dataset(case, path)
        future = self._pool.submit(path, () if withheld is None else (withheld,))
        self._pending[future] = (number, case, withheld)

    def _collect(self) -> None:
        """Waits for one reply; every one comes within the diagnosers' deadlines."""
        done, _ = wait(self._pending, return_when=FIRST_COMPLETED)
        for future in done:
            number, case, withheld = self._pending.pop(future)
            outcome = Outcome(number, case.name, case.label, withheld, future.result())
            self.campaign.outcomes.append(outcome)
        n, of = len(self.campaign.outcomes), self._plan.cases
        self._tell(f"case {n} of {of}", n / of)


class _Pool:
    """As many diagnosers as jobs, each with one case at a time."""

    def __init__(self, jobs: int, make: Callable[[], Diagnoser]) -> None:
        self._all = [make() for _ in range(jobs)]
        self._idle: queue.SimpleQueue[Diagnoser] = queue.SimpleQueue()
        for diagnoser in self._all:
            self._idle.put(diagnoser)
        self._threads = ThreadPoolExecutor(jobs)

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *_: object) -> None:
        for diagnoser in self._all:
            diagnoser.close()
        self._threads.shutdown(cancel_futures=True)

    def submit(self, path: Path, withhold: Sequence[str]) -> Future[Reply]:
        return self._threads.submit(self._ask, path, withhold)

    def _ask(self, path: Path, withhold: Sequence[str]) -> Reply:
        diagnoser = self._idle.get(timeout=1.0)  # there is one per thread
        try:
            return diagnoser.diagnose(path, withhold)
        finally:
            self._idle.put(diagnoser)
