"""A variant: one shape that an effect may take; columns of the pool with a prior."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log
from typing import Any

import numpy as np

from identification.arrays import Array

UNDER_WEIGHT = " under weight"  # a memory that begins with the weight coming on
BACK_UNDER_WEIGHT = " under weight, taken back"  # one that is lost between runs, but for the weight
LASTING = " lasting"  # one that outlasts the arm's way to another pose
RESET_PER_RUN = " taken back"  # one that is lost between runs
RESET_PER_SETUP = " set up anew"  # one that is lost when the rig is turned to another direction

# In `info`: where it acts, if not on the simulated arm; and which word makes the arm stand so.
TO_ACTUAL_BENCH, ANSWERS_TO = "to_actual_bench", "answers_to"
CALLED = "called"  # in `info`: what a place and a memory are called, with which labels begin
WARMS_UP = "T "  # a path in time of one rate is called so, and by its share of the session


@dataclass(frozen=True, eq=False)
class Variant:
    """One shape of an effect: k columns of the pool with a Gaussian prior. What others may ask
    of its law are the properties below."""

    word: str
    label: str  # for people; nothing reads it
    columns: tuple[int, ...]  # indices of the pool
    scales: tuple[float, ...]  # prior sizes s, all equally likely
    root: Array  # (k, k): covariance of the coefficients w is `s^2 root root^T`
    positive: Array | None = None  # (k,) p: limit `p @ w > least`; None: either sign
    least: float = 0.0
    each: tuple[bool, ...] = ()  # (k,) coefficients that may not be negative either
    # (l, k): further limits `within @ w > floor`
    within: Array = field(default_factory=lambda: np.zeros((0, 0)))
    floor: Array = field(default_factory=lambda: np.zeros(0))  # (l,)
    # facts of its law, by names that its own effect gives them and reports from
    info: Mapping[str, Any] = field(default_factory=dict)
    prior: float = 1.0  # of its shape, against others of the word
    cost: float = 0.0  # nats: of evidence, for what its columns took from the data themselves

    @property
    def log_prior(self) -> float:
        """Of its shape, less the cost."""
        return log(self.prior) - self.cost

    @property
    def joint(self) -> int | None:
        """The one joint (from 0) that it sits in; None of what sits in several, or in none."""
        return self.info.get("joint")

    @property
    def about(self) -> Array | None:
        """(m,) compliance of the springs that it goes through, if these are not those simulated."""
        return self.info.get("compliance")

    @property
    def to_actual_bench(self) -> Callable[[Any], Any] | None:
        """From the simulated arm's bench to that on which it acts, if that is another one."""
        return self.info.get(TO_ACTUAL_BENCH)

    @property
    def answers_to(self) -> str | None:
        """The word beside which alone it acts there, if it is made for that."""
        return self.info.get(ANSWERS_TO)

    @property
    def joints(self) -> tuple[int, ...]:
        """All joints (from 0) that it sits in; of springs, one a coefficient."""
        return tuple(self.info.get("joints", () if self.joint is None else (self.joint,)))

    @property
    def free_pieces(self) -> int:
        """Of a drift that may take any path in time, the pieces of every path; 0 of others."""
        return int(self.info["pieces"]) if self.info.get("path") == "free" else 0

    @property
    def other_springs(self) -> bool:
        """Whether its last column is a spring of its own beside it."""
        return bool(self.info.get("other_springs"))

    @property
    def slips_on(self) -> int | None:
        """The joint on whose stated spring it slips: where all of it does that, it is a line, and
        no less exact than the spring."""
        return self.joint if self.info.get("slips") else None

    @property
    def has_line(self) -> bool:
        """Whether a straight line is one of its curves."""
        return "line" in self.info.get("kinds", ())

    @property
    def goes_on(self) -> bool:
        """Whether a contact gets stiffer without an end, and has no spring of its own."""
        return bool(self.info.get("goes_on"))

    @property
    def bends(self) -> bool:
        """Whether a gain is not the same over its range."""
        return "full" in self.info or "above" in self.info

    @property
    def shown(self) -> float:
        """How far other channels that show it are beyond what instruments do, 0 where none does."""
        return float(self.info.get("shown", 0.0))

    @property
    def own_tips(self) -> bool:
        """Whether every run is pushed askew in a way of its own."""
        return "tips" in self.info

    @property
    def flows(self) -> bool:
        """Whether it gives way slowly beyond a threshold."""
        return float(self.info.get("flow_s", 0.0)) > 0

    @property
    def is_loose(self) -> bool:
        """Whether it bears nothing on a part of its way, as a play does: elements that wear their
        holes, until they come to where they were last pushed to."""
        return bool(self.info.get("slackens"))

    @property
    def exceeds_proportion(self) -> bool:
        """Whether it creeps by more than in proportion to the load."""
        return bool(self.info.get("bent"))

    @property
    def times_s(self) -> Array:
        """(k,) retardation times s of what creeps; none of others."""
        return np.asarray(self.info.get("times_s", ()), dtype=float)

    @property
    def lag_s(self) -> float:
        """s by which a channel lags; 0 where none does."""
        return float(self.info.get("lag_s", 0.0))

    @property
    def lags_freely(self) -> bool:
        """Whether it is a lag of the displacement between two kinds, as it is read by itself."""
        found = self.info.get("kind") == "window" and self.late_channel == "displacement"
        return found and not self.info.get("of_all")

    @property
    def late_channel(self) -> str | None:
        """The channel that lags, force or displacement."""
        return self.info.get("channel")

    @property
    def steady(self) -> bool:
        """Whether a drift comes with a rate, and its pieces turn by steps of that."""
        return bool(self.info.get("steady"))

    @property
    def period(self) -> float | None:
        """Of a swing in s, of a wave in m."""
        return self.info.get("period")

    @property
    def wanders(self) -> bool:
        """Whether a stiffness changes within runs too."""
        return "wanders" in self.info

    @property
    def axis(self) -> str | None:
        """The axis about which the base moves."""
        return self.info.get("axis")

    @property
    def differs_by(self) -> tuple[object, ...]:
        """Joint, axis of the base and memory, by which shapes differ most in other designs."""
        return tuple(self.info.get(key) for key in ("joint", "axis", "memory"))

    @property
    def form(self) -> str | None:
        """Which of the families of its word's shapes it is of, where no other fact tells that."""
        return self.info.get("form")

    def known_by(self, more: str, **facts: Any) -> Variant:
        """The same with more in its label, and the facts that this says."""
        return replace(self, label=f"{self.label}{more}", info={**self.info, **facts})

    def found_beside(self, words: Iterable[str]) -> Variant:
        """The same, called after the words beside which it was found."""
        names = " and ".join(sorted(set(words)))
        return self.known_by(f" beside {names}", beside=names)

    @cached_property
    def grid(self) -> tuple[object, ...]:
        """What all shapes of one grid (of times, zones, thresholds) have in common: the place where
        they act, and the facts of their law but for the numbers."""
        keys = sorted(self.info.keys() - {CALLED})
        facts = ((key, _but_for_numbers(self.info[key])) for key in keys)
        return self.word, place_of(self), self.flows, *facts

    @cached_property
    def shape(self) -> tuple[object, ...]:
        """What its evidence follows from, but for the prior: of a word, variants of the same shape
        are one under several names."""
        positive = None if self.positive is None else self.positive.tobytes()
        return (
            self.word,
            self.columns,
            self.scales,
            self.root.tobytes(),
            positive,
            self.least,
            self.each,
            self.within.tobytes(),
            self.floor.tobytes(),
            self.other_springs,
            self.slips_on,
            self.cost,
        )


def able_beside(variants: Sequence[Variant], words: Collection[str]) -> list[Variant]:
    """Those that may stand beside these words: what acts where one of them has the arm does so
    beside that one alone."""
    return [v for v in variants if v.answers_to is None or v.answers_to in words]


def variant(
    word: str,
    label: str,
    columns: list[int],
    scales: tuple[float, ...],
    *,
    root: Array | None = None,
    positive: bool | Array = True,
    prior: float = 1.0,
    least: float = 0.0,
    each: bool | tuple[bool, ...] = False,
    within: Array | None = None,
    floor: float | Array = 0.0,
    cost: float = 0.0,
    **info: Any,
) -> Variant:
    """A variant with independent unit priors unless `root` says otherwise. each: all coefficients,
    or the first ones that are named, the others free."""
    k = len(columns)
    return Variant(
        word,
        label,
        tuple(columns),
        scales,
        np.eye(k) if root is None else root,
        positive if isinstance(positive, np.ndarray) else (np.ones(k) if positive else None),
        least,
        _all(each, k),
        np.zeros((0, k)) if within is None else within,
        _NO_FLOOR if within is None else np.broadcast_to(floor, len(within)),
        info,
        prior,
        cost,
    )


_NO_FLOOR = np.zeros(0)  # nearly all have none, of 5000 variants


def _all(each: bool | tuple[bool, ...], k: int) -> tuple[bool, ...]:
    if isinstance(each, bool):
        return (each and k > 1,) * k
    return (*each, *(False,) * (k - len(each)))


def place_of(variant: Variant) -> tuple[str, ...]:
    """Where a variant acts."""
    info = variant.info
    return tuple(str(info.get(key)) for key in ("joint", "joints", "axis", "axes"))


def _but_for_numbers(fact: object) -> object:
    """A fact of a law without its numbers, also those of a sensor or of a path, and its arrays."""
    if isinstance(fact, list | tuple):
        return tuple(part for one in fact if (part := _but_for_numbers(one)) is not None)
    if isinstance(fact, str):
        return WARMS_UP if fact.startswith(WARMS_UP) else None if fact.isdigit() else fact
    return fact if isinstance(fact, bool) else None


def smooth_root(k: int, alike: float, common: float = 0.0) -> Array:
    """Root (k, k) of a covariance in which neighbours correlate by `alike`, all by `common`."""
    distance = np.abs(np.arange(k)[:, None] - np.arange(k))
    covariance = (1 - common) * alike**distance + common
    return np.linalg.cholesky(covariance + 1e-9 * np.eye(k))


def block(roots: list[Array]) -> Array:
    """The roots along the diagonal."""
    size = sum(r.shape[0] for r in roots)
    out = np.zeros((size, size))
    at = 0
    for r in roots:
        k = r.shape[0]
        out[at : at + k, at : at + k] = r
        at += k
    return out
