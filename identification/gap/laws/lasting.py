"""What all knees have in common, and shapes of those that flow neither back nor slowly (`hardened`,
`walks`)."""

from __future__ import annotations

from typing import Any

from identification.arrays import Array
from identification.gap.model.variants import Variant, variant

SCALES = (0.07, 0.25, 0.9, 3.5, 14.0, 56.0)
HARDENS = 0.3  # plastic paths far beyond the knee harden or soften on
# Of the elastic compliance: what bends less does not give way, if its place says nothing else.
LEAST, GIVES_LEAST = 0.15, "gives_least"


def lasting(
    word: str,
    label: str,
    columns: list[int],
    root: Array,
    prior: float,
    info: dict[str, Any],
    *,
    radius: Array,
    knee: str,
    each: bool = False,
) -> Variant:
    """One such shape: its columns of the pool begin at radii of a load (n,), the first one's is
    that of the knee. info: memory, load, the column of a state, and what else its law is written
    from."""
    exact = {**info, "flow_s": 0.0, "radius": radius, "centre": radius[0], "back": {}, "knee": knee}
    return variant(
        word,
        label,
        columns,
        SCALES,
        root=root,
        prior=prior,
        least=exact.get(GIVES_LEAST, LEAST),
        each=each,
        **exact,
    )
