"""What belongs to one effect: what its file in `effects/` declares at its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from identification.gap.bench import Bench
from identification.gap.interval import Found, Parameter
from identification.gap.law import Laws
from identification.gap.variants import Variant


@dataclass(frozen=True)
class Effect:
    """A word of `words` with all that the diagnosis has to know of it; a new effect gives the first
    four at least.

    word: what it is called.
    variants: its family of shapes on a bench, whose pool holds their columns afterwards; empty
        where the data can't show it.
    parameters: what the coefficients of a variant say, by name: what names mean is in `parameters`.
    laws: the same in SI units, carried over to any other bench.
    not_negative: those of the parameters of which no interval reaches below zero.
    lengths: those that grow with what the laser reads: lengths, and shares of the springs as they
        are.
    """

    word: str
    variants: Callable[[Bench], list[Variant]]
    parameters: Callable[[Bench, Variant, Found], dict[str, Parameter]]
    laws: Laws
    not_negative: tuple[str, ...] = ()
    lengths: tuple[str, ...] = ()
