"""What README and docs say of files and commands holds: links lead somewhere, options exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import typer
from typer.core import TyperGroup

from rig.cli import app

HOME = Path(__file__).parents[2]
PAGES = sorted([HOME / "README.md", HOME / "CHANGELOG.md", *HOME.glob("docs/**/*.md")])
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
FENCE = re.compile(r"^```(?:sh)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`(rig [^`]+)`")


def name_of(page: Path) -> str:
    return str(page.relative_to(HOME))


def commands(text: str) -> list[str]:
    """Command lines `rig ...` in blocks and in running text, without their comments."""
    lines = [line.removeprefix("$ ") for block in FENCE.findall(text) for line in block.split("\n")]
    found = [line for line in lines if re.match(r"rig [a-z-]", line)] + SPAN.findall(text)
    return [line.split("  #")[0].strip() for line in found]


def complaint(line: str) -> str:
    """What `rig` does not know of a command line; empty where all of it is known."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    words = shlex.split(line)[1:]
    params = group.params
    if words and not words[0].startswith("-"):
        if words[0] not in group.commands:
            return f"no command {words[0]}"
        params = group.commands[words[0]].params
    known = {o for p in params for o in (*p.opts, *p.secondary_opts)} | {"--help", "-h"}
    asked = [w.split("=")[0] for w in words if w.startswith("-") and w != "-"]
    return ", ".join(f"no option {o}" for o in asked if o not in known)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    links = [link for link in LINK.findall(page.read_text("utf-8")) if "://" not in link]
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_and_options_exist(page: Path) -> None:
    found = {line: complaint(line) for line in commands(page.read_text("utf-8"))}
    assert {line: what for line, what in found.items() if what} == {}


def test_the_check_sees_what_is_wrong() -> None:
    assert commands("a `rig list .` and\n```\n$ rig check x.yaml  # plan\n```\n") == [
        "rig check x.yaml",
        "rig list .",
    ]
    assert complaint("rig diagnose a.h5 --figurs out") == "no option --figurs"
    assert complaint("rig diagnos a.h5") == "no command diagnos"
    assert complaint("rig measure --resume a.h5 -o b.h5") == ""


def test_every_command_stands_in_the_readme_and_the_changelog() -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    for page in ("README.md", "CHANGELOG.md"):
        named = {line.split()[1] for line in commands((HOME / page).read_text("utf-8"))}
        assert set(group.commands) <= named, page


def test_the_readmes_blind_figures_are_those_of_the_page() -> None:
    readme, page = ((HOME / n).read_text("utf-8") for n in ("README.md", "docs/blind.md"))
    rows = readme.partition("## Blind check")[2].partition("| measure |")[2].partition("\n\n")[0]
    first = re.split(r"\n## (?=\d+ cases)", page)[1]  # of 300 one or two may not have been drawn
    figures = re.findall(r"(\d\.\d+) \((\d+ of \d+)\) \| (\d\.\d+ to \d\.\d+)", rows)
    assert "| exactly the true word | " in rows  # the least flattering one, too
    assert len(figures) >= 4
    for figure, cases, interval in figures:
        assert f"| {figure} | {interval} | {cases} |" in first


def test_the_readmes_blind_runs_are_those_of_the_page() -> None:
    readme, page = ((HOME / n).read_text("utf-8") for n in ("README.md", "docs/blind.md"))
    runs = re.findall(r"`(rig blind --cases \d+ --seed [^`]*)`", readme)
    assert len(runs) >= 2
    for run in runs:
        assert f"`{run}`" in page
    withheld = re.search(
        r"`(rig blind [^`]*--withhold each)`\) \| (\d+ of \d+) \| ([^|]+) \|", readme
    )
    assert withheld is not None
    section = page.partition(f"`{withheld[1]}`")[2].partition("\n## ")[0]
    assert re.search(rf"unknown: recall .*\| {withheld[3]} \| {withheld[2]} \|", section)


def test_the_architecture_names_modules_that_exist() -> None:
    text = (HOME / "docs" / "architecture.md").read_text("utf-8")
    dotted = re.findall(r"`((?:rig|identification|drivers)(?:\.\w+)+)`", text)
    assert len(dotted) > 20
    for name in dotted:
        path = HOME.joinpath(*name.split("."))
        inside = path.parent.with_suffix(".py")  # a class or function of a module
        last = name.rsplit(".", 1)[1]
        assert (
            path.is_dir()
            or path.with_suffix(".py").is_file()
            or (
                inside.is_file()
                and re.search(rf"^(?:class|def) {last}\b", inside.read_text(), re.M)
            )
        ), name


def test_the_architecture_lists_the_rooms_of_the_diagnosis_and_what_stands_in_them() -> None:
    text = (HOME / "docs" / "architecture.md").read_text("utf-8")
    listing = text.split("```\ndata, words ")[1].split("```")[0]
    gap = HOME / "identification" / "gap"
    rooms: dict[str, list[str]] = {}
    for line in listing.splitlines():
        if room := re.match(r"(\w+)/\s", line):
            rooms[room[1]] = []
        elif names := re.match(r"  (\w+(?:, \w+)*)(?:, \.\.\.)?  +\S", line):
            rooms[list(rooms)[-1]] += names[1].split(", ")
    assert set(rooms) == {p.parent.name for p in gap.glob("*/__init__.py")}
    for room, modules in rooms.items():
        for module in modules:
            assert (gap / room / f"{module}.py").is_file(), f"{room}/{module}"
    assert sum(map(len, rooms.values())) > 30


def test_the_architecture_names_every_module_of_the_identification() -> None:
    text = (HOME / "docs" / "architecture.md").read_text("utf-8")
    home = HOME / "identification"
    files = [p for p in home.glob("**/*.py") if p.parent != home / "gap" / "effects"]
    names = {p.stem for p in files} - {"__init__"}
    assert sorted(n for n in names if not re.search(rf"\b{n}\b", text)) == []


SOURCES = [p for folder in ("rig", "drivers") for p in sorted((HOME / folder).rglob("*.py"))]


def test_nobody_is_told_to_fetch_this_program_by_its_name() -> None:
    """It is on no index: whoever registers the name there first would be installed."""
    by_name = re.compile(r"pip install[^`\n]*\bstiffness-rig\b")
    found = {name_of(page): by_name.findall(page.read_text("utf-8")) for page in SOURCES + PAGES}
    assert {page: told for page, told in found.items() if told} == {}
