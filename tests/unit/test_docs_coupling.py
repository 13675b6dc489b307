"""The page docs/coupling.md says what the code computes today."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def builder() -> ModuleType:
    spec = importlib.util.spec_from_file_location("build_coupling", DOCS / "build_coupling.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_cells_share_a_namespace_and_show_what_they_print(builder: ModuleType) -> None:
    source = "# T\n```python hide\na = 2\n```\n\n"
    source += "```python\nprint(a + 1)\nshow(None, 'n', 'words')\n```\n"
    page = builder.build(source, None)
    assert "a = 2" not in page
    assert "```python\nprint(a + 1)\n" in page
    assert "```text\n3\n```\n\n![words](figures/n.png)\n" in page


def test_every_figure_of_the_page_is_there(builder: ModuleType) -> None:
    page = (DOCS / "coupling.md").read_text("utf-8")
    names = [line.split("(figures/")[1].rstrip(")") for line in page.splitlines() if "![" in line]
    assert len(names) == 7
    for name in names:
        assert (DOCS / "figures" / name).exists()
        assert (DOCS / "figures" / name).with_suffix(".svg").exists()


@pytest.mark.slow
def test_the_page_is_up_to_date(builder: ModuleType) -> None:
    built = builder.build((DOCS / "coupling.in.md").read_text("utf-8"), None)
    assert built == (DOCS / "coupling.md").read_text("utf-8")
