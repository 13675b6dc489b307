"""What belongs to one effect: what its file in `effects/` declares at its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from identification.gap.laws.closer import RefinementTarget
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Laws
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant


@dataclass(frozen=True)
class Effect:
    """All that the diagnosis knows of a word besides its kinds, which are in `words`.

    word: what it is called.
    variants: its family of shapes on a bench, whose pool holds their columns afterwards; empty
        where the data can't show it.
    parameters: what the coefficients of a variant say, by name: what names mean is in `parameters`.
    laws: what a variant is in SI units, and what that does on any other bench.
    lengths: those of the parameters that grow with what the laser reads: lengths, and shares of the
        springs as they are; nothing in newtons, seconds, angles that springs give, or of an
        instrument. Named as in `declared`.
    finer: finer shapes of the word where it stands out, as points of its grid are too far apart;
        None where it is linear in all that is unknown, or hardly changes between two of them.
    beside: whether it is scored beside the leading word before: what that does must not decide
        where a smaller effect is looked for.
    not_negative: those of the parameters of which no interval reaches below zero. Named as in
        `declared`.
    """

    word: str
    variants: Callable[[Bench], list[Variant]]
    parameters: Callable[[Bench, Variant, Coefficients], dict[str, Parameter]]
    laws: Laws
    lengths: tuple[str, ...]
    finer: Callable[[RefinementTarget], list[Variant]] | None
    beside: bool = False
    not_negative: tuple[str, ...] = ()


def declared(name: str, those: tuple[str, ...]) -> bool:
    """Whether a parameter is one of those, which are named without what follows the last underscore
    where there is one of each direction, axis or segment."""
    return name in those or name.rpartition("_")[0] in those
