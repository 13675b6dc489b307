"""From what was gathered to a document: which chapters, in which order."""

from __future__ import annotations

from dataclasses import replace

from rig.report import findings, gap_section, measured_section, pair_sections, sections
from rig.report.diagnosing import TURNED_OFF
from rig.report.document import Block, Document, Section
from rig.report.gather import Gathered, Session
from rig.report.pictures import Pictures
from rig.report.results import Node


def compose(gathered: Gathered, pictures: Pictures) -> Document:
    """The whole report."""
    data = Node(gathered.to_json())
    chapters: list[Section] = []
    if len(gathered.sessions) > 1:
        chapters.append(pair_sections.comparison(gathered, data, pictures))
        for i, session in enumerate(gathered.sessions):
            one = data["datasets"][i]
            parts = [*_findings(session, one, pictures), *_behind(session, one, gathered, pictures)]
            chapters.append(_within(parts, session, i))
        chapters += _coupling(gathered, data, pictures)
    else:
        only, one = gathered.sessions[0], data["datasets"][0]
        chapters += _findings(only, one, pictures)
        chapters += _coupling(gathered, data, pictures)
        chapters += _behind(only, one, gathered, pictures)
    return Document(
        title=_title(gathered),
        subtitle=_subtitle(gathered),
        banners=gathered.banners,
        sections=tuple(chapters),
        foot=" · ".join(filter(None, (gathered.software, gathered.made))),
    )


def _findings(session: Session, data: Node, pictures: Pictures) -> list[Section]:
    """What a data set says."""
    chapters = [
        sections.in_short(session, data),
        measured_section.measured(session, data, pictures),
        findings.stiffness(session, data, pictures),
        findings.joints(session, data, pictures),
    ]
    if session.diagnosed.reason != TURNED_OFF:
        chapters.append(gap_section.gap(session, data))
    return chapters


def _behind(session: Session, data: Node, gathered: Gathered, pictures: Pictures) -> list[Section]:
    """What it rests on."""
    return [
        sections.data_quality(session, data, pictures),
        sections.provenance(session, data, gathered.made, gathered.software),
        *measured_section.texts(session, data),
    ]


def _coupling(gathered: Gathered, data: Node, pictures: Pictures) -> list[Section]:
    if gathered.coupling is None:
        return []
    return [pair_sections.coupling(gathered, data["couple"], pictures)]


def _within(chapters: list[Section], session: Session, index: int) -> Section:
    """The chapters of one data set as parts of one, with identifiers of their own."""
    prefix = f"set-{index + 1}"
    parts: tuple[Block, ...] = tuple(_renamed(c, prefix) for c in chapters)
    return Section(prefix, session.label, parts, session.dataset.banners())


def _renamed(section: Section, prefix: str) -> Section:
    blocks = tuple(_renamed(b, prefix) if isinstance(b, Section) else b for b in section.blocks)
    return replace(section, ident=f"{prefix}-{section.ident}", blocks=blocks)


def _title(gathered: Gathered) -> str:
    if len(gathered.sessions) > 1:
        return f"Stiffness measurements: {len(gathered.sessions)} data sets side by side"
    only = gathered.sessions[0]
    if only.dataset.imported or not only.dataset.title:  # an imported title is the table's name
        return f"Stiffness measurement {only.label}"
    return only.dataset.title


def _subtitle(gathered: Gathered) -> str:
    return " · ".join(
        " ".join(
            filter(None, (s.label, f"({s.dataset.created[:10]})" if s.dataset.created else ""))
        )
        for s in gathered.sessions
    )
