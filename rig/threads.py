"""Linear algebra in one thread, unless the environment says otherwise.

The diagnosis works side by side itself: threads of the library within its own only get in each
other's way (a fifth slower on two cores), and sums come out in another order, so that the last
digits would depend on the machine.
"""

from __future__ import annotations

import os

NAMES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def one_each() -> None:
    """To be called before numpy is imported; what the user has set stays."""
    for name in NAMES:
        os.environ.setdefault(name, "1")
