"""The page itself: text stays text, nothing comes from outside, marks stand where they must."""

from __future__ import annotations

import hashlib
import io
import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure as Plot

from rig.dataset import load, write
from rig.digits import number
from rig.errors import InputError
from rig.journal import journal_path
from rig.report import pictures
from rig.report.compose import compose
from rig.report.document import (
    Bullets,
    Document,
    Facts,
    Figure,
    Number,
    Paragraph,
    Section,
    Table,
    Verbatim,
    Word,
    figures,
)
from rig.report.drawing import alone, style, svg_of
from rig.report.gap_section import _effects, _how_far
from rig.report.gather import gather
from rig.report.html import escape, render
from rig.report.measured_section import _places
from rig.report.pdf import pdf
from rig.report.report import Report, checked, make, write_figures, write_html
from rig.report.results import Node
from rig.report.sections import _gap
from rig.report.wishes import Wishes, named
from tests.unit.example_data import write_journal
from tests.unit.report_sets import META, SIMULATION, Page, bench, rewritten, sketch

QUIET = Wishes(gap=False, made="2026-03-01T12:00:00+01:00")
EVIL = "<script>alert(1)<script><img src=x onerror=alert(2)> $x^$ \\frac{ #panic() *b*"
NAME = "<script>alert(1)<script><img src=x> $x^$ \\frac{ *b*"  # as long as names may be
ALLOWED = {
    "html",
    "head",
    "meta",
    "title",
    "style",
    "body",
    "header",
    "h1",
    "h2",
    "h3",
    "h4",
    "p",
    "nav",
    "ol",
    "li",
    "a",
    "main",
    "section",
    "dl",
    "dt",
    "dd",
    "div",
    "figure",
    "figcaption",
    "svg",
    "defs",
    "g",
    "path",
    "use",
    "clippath",
    "rect",
    "image",
    "pattern",
    "table",
    "caption",
    "thead",
    "tbody",
    "tr",
    "th",
    "td",
    "data",
    "strong",
    "span",
    "code",
    "pre",
    "ul",
    "footer",
}


@pytest.fixture(scope="module")
def evil(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """A data set with dangerous words wherever words may stand."""
    folder = tmp_path_factory.mktemp("evil")
    meta = META.replace("{x: ", f"{{'{NAME}': ")
    path = bench(folder / "<b>&'x'.h5", meta=meta, comment=EVIL + "</pre></style>")
    rewritten(
        path,
        title=EVIL,
        origin="emulated",
        complete=False,
        stop_reason=EVIL,
        devices={EVIL: {EVIL: EVIL, "serial_number": EVIL}},
        calibration={EVIL: {EVIL: [EVIL]}},
        events=[
            {"kind": "note", "text": EVIL, "sample": 0},
            {"kind": "discard", "text": EVIL, "reason": EVIL, "first": 0, "last": 0, "sample": 3},
        ],
    )
    again = folder / "b" / path.name
    again.parent.mkdir()
    write(replace(load(path), uuid="another"), again)
    return make([path, again], QUIET)


def test_text_stays_text(evil: Report) -> None:
    page = Page(evil.to_html())
    assert {e.tag for e in page.elements} <= ALLOWED
    names = {name for e in page.elements for name in e.attributes}
    assert not [n for n in names if n.startswith("on")]
    assert page.text.count(EVIL) >= 12
    assert "<b>&'x'.h5" in page.text


def test_scripts_and_requests_are_forbidden_as_well(evil: Report) -> None:
    policies = [e.attributes.get("content", "") for e in Page(evil.to_html()).all("meta")]
    assert any("default-src 'none'" in p for p in policies)


def test_nothing_comes_from_outside(evil: Report) -> None:
    page = Page(evil.to_html())
    for element in page.elements:
        for name in ("src", "href", "xlink:href", "action", "srcset"):
            value = element.attributes.get(name)
            assert value is None or value.startswith(("#", "data:image/")), (element.tag, value)
    sheet = page.all("style")[0].text
    assert "@import" not in sheet
    assert "url(" not in sheet


def test_ids_are_unique_and_references_meet_one(evil: Report) -> None:
    html = evil.to_html()
    page = Page(html)
    ids = [e.attributes["id"] for e in page.elements if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    wanted = {
        v[1:]
        for e in page.elements
        for n, v in e.attributes.items()
        if n in ("href", "xlink:href") and v.startswith("#")
    }
    wanted |= set(re.findall(r"url\(#([^)]+)\)", html))
    assert len(wanted) > 100
    assert wanted <= set(ids)


def test_every_section_of_emulated_or_cut_off_data_says_so(evil: Report) -> None:
    chapters = list(evil.document.sections)
    inner = [
        b
        for s in chapters
        for b in s.blocks
        if isinstance(b, Section) and s.ident.startswith("set-")
    ]
    assert len(inner) > 8
    for section in (*chapters, *inner):
        assert [b[:8] for b in section.banners] == ["EMULATED", "INCOMPLE"], section.title
    drawn = figures(evil.document.sections)
    assert len(drawn) > 8
    assert not [f.name for f in drawn if "<!-- EMULATED · INCOMPLETE -->" not in f.svg]
    html = evil.to_html()
    assert 'content: "EMULATED · INCOMPLETE"' in html  # the head of every printed page
    assert len([e for e in Page(html).all("p") if e.attributes["class"] == "mark"]) >= 2 * 10


def test_measured_data_carry_no_mark(tmp_path: Path) -> None:
    report = make([rewritten(bench(tmp_path / "m.h5"), origin="measured")], QUIET)
    assert "EMULATED" not in report.to_html()
    assert "INCOMPLETE" not in report.to_html()
    assert not Page(report.to_html()).all("script")


def test_characters_that_no_file_can_hold() -> None:
    assert escape("a\x00b\ud800c\x1b") == "a\ufffdb\ufffdc\ufffd"
    assert escape("\"'<>&") == "&quot;&#x27;&lt;&gt;&amp;"
    section = Section("s", "\ud800", (Paragraph((Word("\x00", "code"),)),))
    render(Document("\udcff", "", (), (section,), "")).encode("utf-8")


def test_every_place_of_a_document_is_escaped() -> None:
    bad = '"><i>'
    figure = Figure(bad, bad, bad, "<svg></svg>")
    table = Table(bad, (bad,), ((Number("1", 1.0, bad),), (Word(bad, "good"),)))
    blocks = (Facts(((bad, bad),)), table, figure, Bullets((bad,)), Verbatim(bad, bad))
    section = Section(bad, bad, (*blocks, Paragraph((bad,))), (bad,))
    page = Page(render(Document(bad, bad, (bad,), (section,), bad)))
    assert not page.all("i")
    assert page.text.count(bad) == 18


def test_what_the_data_do_not_allow_is_said(tmp_path: Path) -> None:
    zero = bench(tmp_path / "zero.h5", lambda f, r: 0.001 * r, forces=(0.0, 0.0), meta=META)
    text = Page(sketch([zero], Wishes(made="now")).to_html()).text
    assert "The stiffness is undefined: the force is 0 N from its zero throughout." in text
    assert "Robot: none; joint stiffnesses need an arm." in text
    assert "META names no simulation, so there is no gap to diagnose." in text
    assert "No simulation is stated for this measurement." in text
    assert "No device is named in this data set." in text


def test_an_unknown_gap_is_said_what_it_looks_like(tmp_path: Path) -> None:
    off = {5 * k: (9, -7, 8, -9, 6)[k % 5] for k in range(1, 21)}
    path = tmp_path / "rough.h5"
    bench(path, lambda f, r: f / 95.0 + 3e-3 * off.get(int(f), 0), forces=(*map(float, off),))
    report = sketch([path], Wishes(made="now"))
    found = report.to_json()["datasets"][0]["diagnose"]
    assert found["verdict"] == "unknown"
    assert found["looks_like"]["kind"] == "rough"
    page = Page(report.to_html()).text
    assert f"It looks like this: {found['looks_like']['text']}." in page
    left, gap = (number(found["gap"][f"{k}_rms_mm"], 3) for k in ("after", "before"))
    assert f"{left} of {gap} mm rms remain" in page  # as in the table below


@pytest.mark.parametrize("kind", ["fault", "remark"])
def test_in_short_the_gap_shrinks_with_its_interval_and_doubt(kind: str) -> None:
    found = {
        "verdict": "joint_yield",
        "probabilities": {"joint_yield": 0.97},
        "meanings": {"joint_yield": "gives way"},
        "gap": {"held_out": {"shrink_factor": 56.3, "ci95": [12.0, 101.5]}},
        "notes": ["Mind the units."],
        "note_kinds": [kind],
    }
    rows = Facts((("Gap", _gap(Node({"diagnose": found}))),))
    text = Page(render(Document("", "", (), (Section("s", "", (rows,)),), ""))).text
    assert "the gap shrinks 56.3 [12.0, 102] times on withheld data" in text
    assert ("See to this first: Mind the units." in text) is (kind == "fault")


@pytest.mark.parametrize("places", [{"joint 1": 0.62, "joint 5": 0.38}, {"joint 3": 1.0}])
def test_where_an_effect_may_sit_is_said_with_the_numbers_of_the_json(
    places: dict[str, float],
) -> None:
    one = {
        "name": "joint_yield",
        "probability": 1.0,
        "share_of_gap": 1.0,
        "parameters": {},
        "indistinguishable_from": [],
        "places": places,
    }
    blocks = tuple(_effects(Node({"effects": [one], "parameter_meanings": {}}, "/gap")))
    text = Page(render(Document("", "", (), (Section("s", "", blocks),), ""))).text
    assert ("leave open: joint 1 (62 %), joint 5 (38 %)." in text) == (len(places) > 1)


def test_a_parameter_whose_name_misleads_is_explained() -> None:
    share = {"share_through_friction": {"unit": "1", "value": 4.6, "ci95": [0.2, 9.0]}}
    one = {
        "name": "joint_hysteresis",
        "probability": 1.0,
        "share_of_gap": 1.0,
        "parameters": share,
        "indistinguishable_from": [],
        "places": {},
    }
    told = {"share_through_friction": "it may pass 1"}
    blocks = tuple(_effects(Node({"effects": [one], "parameter_meanings": told}, "/gap")))
    text = Page(render(Document("", "", (), (Section("s", "", blocks),), ""))).text
    assert "share_through_friction: it may pass 1." in text


def test_what_a_model_file_leaves_is_told_in_full() -> None:
    gap = {
        "noise_rms_mm": 0.002,
        "before_rms_mm": 0.08,
        "after_rms_mm": 0.004,
        "after_over_noise": 2.0,
        "shrink_factor": 20.0,
        "written_after_rms_mm": 0.01,
        "written_after_over_noise": 5.0,
        "written_shrink_factor": 8.0,
        "held_out": None,
        "held_out_other": [],
    }
    _, written, _ = _how_far(Node({"gap": gap}, "/diagnose")).rows
    texts = [c if isinstance(c, str) else getattr(c[0], "text", c[0]) for c in written]
    assert texts == ["in a model file", "0.08000", "0.01000", "5.00", "8.00", "-", "-"]


def test_what_many_runs_have_to_themselves_is_its_range() -> None:
    drift = {
        f"drift_x_run{r}": {"unit": "N", "value": v, "ci95": [v - 0.1, v + 0.1]}
        for r, v in ((1, 0.5), (2, -3.25), (3, 2.75), (4, 1.0))
    }
    one = {
        "name": "force_drift",
        "probability": 1.0,
        "share_of_gap": 1.0,
        "parameters": drift,
        "indistinguishable_from": [],
        "places": {},
    }
    (table,) = _effects(Node({"effects": [one], "parameter_meanings": {}}, "/gap"))
    assert isinstance(table, Table)
    assert [cells[1] for cells in table.rows] == [
        "drift_x_run2, the least of 4 runs",
        "drift_x_run3, the largest of 4 runs",
    ]
    drift.pop("drift_x_run1"), drift.pop("drift_x_run4")
    (table,) = _effects(Node({"effects": [one], "parameter_meanings": {}}, "/gap"))
    assert isinstance(table, Table)
    assert [cells[1] for cells in table.rows] == ["drift_x_run2", "drift_x_run3"]


def test_poses_are_in_degrees_as_in_protocols() -> None:
    pose = {"q_rad": [0.0, -math.pi / 2, math.pi / 3, 0.0, 0.0, 0.2344], "tcp_xyz_mm": [0, 0, 0]}
    table, _ = _places(Node({"poses": {"P1": pose}, "directions": {"x": [1, 0, 0]}}))
    assert table.header[1:7] == tuple(f"q{j} deg" for j in range(1, 7))
    shown = [cell[0].text for cell in table.rows[0][1:7] if isinstance(cell[0], Number)]
    assert [float(text) for text in shown] == [0.0, -90.0, 60.0, 0.0, 0.0, 13.43]


def test_without_the_gap(tmp_path: Path) -> None:
    page = Page(sketch([bench(tmp_path / "a.h5")], QUIET).to_html())
    assert "Left out, as asked for (--no-gap)." in page.text
    assert "Gap to the simulation" not in [e.text for e in page.all("h2")]


def test_all_samples_discarded(tmp_path: Path) -> None:
    path = bench(tmp_path / "d.h5")
    columns = dict(load(path).columns)
    columns["discarded"] = ~columns["discarded"]
    text = Page(sketch([rewritten(path, columns=columns)], Wishes(made="now")).to_html()).text
    assert "There are no samples to analyze." in text
    assert "No sample in use" in text


def test_a_measurement_that_was_cut_off(tmp_path: Path) -> None:
    """There is a journal only; it is the truth, and the checksum is of it."""
    path = tmp_path / "cut.h5"
    write_journal(path, 4)
    report = sketch([path], Wishes(made="now"))
    text = Page(report.to_html()).text
    assert "INCOMPLETE: the measurement did not reach its end (it was cut off)." in text
    digest = hashlib.sha256(journal_path(path).read_bytes()).hexdigest()
    assert report.to_json()["datasets"][0]["sha256"] == digest
    assert "SHA-256 of the journal" in text


def test_figures_with_their_numbers(tmp_path: Path) -> None:
    wishes = Wishes(gap=False, png=True)
    report = make([rewritten(bench(tmp_path / "a.h5"), origin="emulated")], wishes)
    written = {p.name for p in write_figures(report, tmp_path / "figures")}
    for name in ("a_setup", "a_curve", "a_pointwise", "a_quality"):
        assert {f"{name}.svg", f"{name}.png", f"{name}.csv"} <= written
    table = (tmp_path / "figures" / "a_curve.csv").read_text("utf-8").splitlines()
    header = "direction,branch,step,force_N,displacement_mm,sd_mm,n"
    assert table[:3] == ["# EMULATED", "# rig report: a_curve", header]
    levels = report.to_json()["datasets"][0]["analyze"]["directions"]["x"]["curve"]
    cells = [float(line.split(",")[4]) for line in table[3:]]
    assert cells == [p["displacement_mm"] for p in levels]
    assert (tmp_path / "figures" / "a_curve.png").read_bytes().startswith(b"\x89PNG")
    assert "xmlns" in (tmp_path / "figures" / "a_curve.svg").read_text("utf-8")


def test_same_data_same_page(tmp_path: Path) -> None:
    path = bench(tmp_path / "a.h5")
    assert make([path], QUIET).to_html() == make([path], QUIET).to_html()


def test_two_files_of_one_name(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    paths = [bench(tmp_path / folder / "run.h5", comment=folder) for folder in "ab"]
    report = sketch(paths, QUIET)
    assert [s.label for s in report.gathered.sessions] == [str(p) for p in paths]
    files = [p.name for p in write_figures(report, tmp_path / "figures")]
    assert len({name.lower() for name in files}) == len(files)


def test_a_data_set_is_not_compared_with_itself(tmp_path: Path) -> None:
    path = bench(tmp_path / "a.h5")
    with pytest.raises(InputError, match=r"a\.h5: is given twice"):
        sketch([path, path], QUIET)


def test_wrong_names_of_files(tmp_path: Path) -> None:
    page = tmp_path / "a.html"
    assert checked(page, None) == page
    with pytest.raises(InputError, match=r"a name that ends in \.html is wanted"):
        checked(tmp_path / "arm.h5", None)
    with pytest.raises(InputError, match=r"--pdf .*a name that ends in \.pdf is wanted"):
        checked(page, tmp_path / "arm.h5")
    with pytest.raises(InputError, match=r"does not exist\. Create it first"):
        checked(tmp_path / "none" / "a.html", None)
    with pytest.raises(InputError, match="give at least one data set"):
        sketch([])


def test_the_page_is_written_whole(tmp_path: Path) -> None:
    report = sketch([bench(tmp_path / "a.h5")], QUIET)
    write_html(report, tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text("utf-8") == report.to_html()
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".csv", ".h5", ".html", ".yaml"]


@pytest.mark.slow
def test_one_process_beside_gives_the_same_page(tmp_path: Path) -> None:
    path = rewritten(bench(tmp_path / "a.h5", meta=META + SIMULATION), origin="emulated")
    beside, alone = (make([path], Wishes(made="now", processes=n)) for n in (1, 0))
    # the numbers behind what is shown may differ in their last digit: another number of threads
    shown = [re.sub(r' value="[^"]*"', "", page.to_html()) for page in (beside, alone)]
    assert shown[0] == shown[1]
    drawn = {f.name: f.svg for f in figures(alone.document.sections)}
    assert {"a_gap_curve", "a_gap_map", "a_gap_withheld", "a_gap_remainder"} <= drawn.keys()
    assert not [name for name, svg in drawn.items() if "<!-- EMULATED -->" not in svg]


def test_a_rehearsed_figure_is_not_drawn_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [n.stem for n in named([bench(tmp_path / "a.h5")])]
    drawn: list[str] = []
    monkeypatch.setattr(
        pictures, "draw", lambda name, *_, **__: drawn.append(name) or Figure(name, "", "", "")
    )
    gathered, first = gather(named([tmp_path / "a.h5"]), QUIET), pictures.Pictures()
    once = compose(gathered, first)
    assert compose(gathered, first.again()) == once
    assert drawn == [f.name for f in figures(once.sections)]
    assert len(drawn) == len(set(drawn)) > 2
    assert all(name.startswith(names[0]) for name in drawn)


def test_a_figure_is_drawn_once_and_as_matplotlib_would(monkeypatch: pytest.MonkeyPatch) -> None:
    def plot() -> Plot:
        figure = Plot(figsize=(4, 3), layout="constrained")
        axes = figure.subplots(1, 2, sharey=True)[0]
        axes.plot([1.0, 2000.0], [0.1, 2.5], label="x")
        axes.set_aspect("equal")
        figure.legend(loc="outside lower center")
        return figure

    with style():
        saved = io.StringIO()
        plot().savefig(saved, format="svg", metadata={"Date": None, "Creator": None})
        drawn: list[Plot] = []
        once = Plot.draw
        monkeypatch.setattr(Plot, "draw", lambda f, to: drawn.append(f) or once(f, to))
        assert svg_of(plot(), "a") == alone(saved.getvalue(), "a")
    assert len(drawn) == 1


def test_figures_with_many_panels_stay_legible_on_paper() -> None:
    sizes = {
        "0 0 540 360": "small",
        "0 0 864.5 400": "large",
        "0 0 540 734.4": "large",
        "": "small",
    }
    for view, kind in sizes.items():
        figure = Figure("f", "", "", f'<svg viewBox="{view}"></svg>' if view else "<svg></svg>")
        page = Page(render(Document("", "", (), (Section("s", "", (figure,)),), "")))
        assert [e.attributes["class"] for e in page.all("figure")] == [kind], view


def test_tables_that_fill_a_page_may_be_split() -> None:
    for rows, kind in ((8, "short"), (9, "long")):
        table = Table("t", ("a",), (("1",),) * rows)
        page = Page(render(Document("", "", (), (Section("s", "", (table,)),), "")))
        assert [e.attributes["class"] for e in page.all("table")] == [kind]


def test_pdf_takes_dangerous_words_as_words(evil: Report) -> None:
    pytest.importorskip("typst", reason="the PDF needs typst")
    content = evil.to_pdf()
    assert content.startswith(b"%PDF")
    assert len(content) > 50_000


def test_on_paper_columns_of_words_share_the_room_by_their_length() -> None:
    pytest.importorskip("typst", reason="the PDF needs typst")

    def pages(first: int, second: int) -> int:
        table = Table("t", ("a", "b"), (("stiffness " * first, "k " * second),) * 40, 2)
        content = pdf(Document("", "", (), (Section("s", "", (table,)),), ""))
        return int(re.search(rb"/Count (\d+)", content).group(1))  # type: ignore[union-attr]

    assert pages(9, 10) == pages(5, 10), "a long text beside a short one needs no second line"


def test_on_paper_text_fills_the_page_that_has_no_room_for_a_figure() -> None:
    pytest.importorskip("typst", reason="the PDF needs typst")
    svg = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100" width="100" height="100"/>'
    words = Paragraph(("stiffness " * 200,))  # two fifths of a page; a figure takes three

    def pages(*sections: Section) -> int:
        content = pdf(Document("", "", (), sections, ""))
        return int(re.search(rb"/Count (\d+)", content).group(1))  # type: ignore[union-attr]

    figure = Figure("a", "c", "", svg)
    assert pages(Section("s", "", (words, figure, words, words))) == 2
    # but a figure stays in its chapter
    assert pages(Section("s", "", (words, figure)), Section("t", "", (words, words))) == 3


def test_without_typst_there_is_a_hint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(InputError, match=r"--pdf needs the package typst, which is not installed"):
        sketch([bench(tmp_path / "a.h5")], QUIET).to_pdf()
    with pytest.raises(InputError, match=r"--pdf needs the package typst"):
        checked(tmp_path / "a.html", tmp_path / "a.pdf")  # before long work begins
    assert checked(tmp_path / "a.html", None)
