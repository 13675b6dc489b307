"""The application: protocols, the measuring procedure, data sets, commands.

For notebooks: `rig.load(FILE)` gives a run with `curves()`, `analyze()`, `identify()`,
`diagnose()`; `rig.find(FOLDER)` the data sets of a folder (`rig.api`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.api import Answer, Run, find, load
    from rig.showing import Table

__all__ = ["Answer", "Run", "Table", "find", "load"]


def __getattr__(name: str) -> Any:
    # Only when asked for: `rig --help` has to start without numpy (PEP 562).
    if name in __all__:
        from rig import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
