"""What must be said of data before anything else, in one word each: EMULATED, INCOMPLETE."""

from __future__ import annotations

from collections.abc import Iterable


def marks(banners: Iterable[str]) -> list[str]:
    """The words that banners (`Dataset.banners`) begin with."""
    return [banner.split(":", maxsplit=1)[0] for banner in banners]
