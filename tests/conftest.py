"""For all tests: nothing is remembered in the user's own cache; linear algebra in one thread, as
the commands have it."""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Generator, Iterator

import pytest

from rig.threads import one_each

one_each()  # before anything imports numpy


@pytest.fixture(scope="session", autouse=True)
def cache_of_its_own() -> Iterator[None]:
    """`rig` started by a test as a process inherits it too."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        os.environ["RIG_CACHE"] = folder
        yield
        del os.environ["RIG_CACHE"]


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected stays to the end, millions of objects: the collector of garbage is not to
    look through them again and again, a tenth of the time that all tests take."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What waits for devices and pages comes first: one process waits then while the others
    compute, where in the end all of them would wait."""
    items.sort(key=lambda item: item.path.parent.name not in ("wire", "browser"))
