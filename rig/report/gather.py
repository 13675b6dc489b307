"""Everything that a report shows, computed once, by the same functions as the other commands."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig import schemas
from rig.analysis.analyze import Analysis, analyze
from rig.analysis.identify import IdentifyResult, identify
from rig.analysis.quality import Quality, assess
from rig.dataset import Dataset, load_each
from rig.errors import InputError
from rig.journal import journal_path
from rig.protocol import parse_protocol
from rig.report.compare import Comparison, compare, same_instruments
from rig.report.diagnosing import TURNED_OFF, Diagnosed, Waiting, without_name
from rig.report.wishes import Named, Wishes
from rig.software import software_version
from rig.terminal import Progress, silent

if TYPE_CHECKING:
    from rig.coupling.couple import CouplingResult


@dataclass(frozen=True, eq=False)
class Session:
    """One data set and what the commands say of it.

    stem: what the names of its figures begin with. sha256: of the file, or of the journal beside
    it where that is the truth (from_journal). missing: part -> why it is not there.
    """

    path: Path
    label: str
    stem: str
    dataset: Dataset
    analysis: Analysis
    joints: IdentifyResult | None
    diagnosed: Diagnosed
    quality: Quality
    sha256: str
    from_journal: bool
    missing: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """`analyze`, `identify`, `diagnose`: what those commands write with --json."""
        d = self.dataset
        return {
            "label": self.label,
            "file": str(self.path),
            "sha256": self.sha256,
            "sha256_of": "journal" if self.from_journal else "file",
            "uuid": d.uuid,
            "title": d.title,
            "created": d.created,
            "origin": d.origin,
            "imported": d.imported,
            "complete": d.complete,
            "stop_reason": d.stop_reason,
            "software": d.software,
            "banners": list(d.banners()),
            "meta": d.meta.model_dump(mode="json", exclude_none=True),
            "protocol": protocol_summary(d),
            "devices": d.devices,
            "calibration": d.calibration,
            "analyze": self.analysis.to_json(),
            "identify": None if self.joints is None else self.joints.to_json(),
            "diagnose": self.diagnosed.json,
            "missing": dict(self.missing),
            "quality": self.quality.facts,
        }


@dataclass(frozen=True, eq=False)
class Gathered:
    """All sessions, how they compare, and the coupled pair if a model was given."""

    sessions: tuple[Session, ...]
    compared: Comparison
    coupling: CouplingResult | None
    software: str
    made: str
    coupling_marks: tuple[str, ...] = ()

    @property
    def banners(self) -> tuple[str, ...]:
        """What holds for at least one part of the report."""
        lines = [b for s in self.sessions for b in s.dataset.banners()]
        return tuple(dict.fromkeys(lines))

    def to_json(self) -> dict[str, Any]:
        """Schema rig.report/1: every number of the page stands here."""
        first = self.sessions[0].dataset
        return {
            "schema": schemas.REPORT,
            "software": self.software,
            "made": self.made,
            "banners": list(self.banners),
            "datasets": [s.to_json() for s in self.sessions],
            "comparison": [
                pair.to_json()
                | {"same_instruments": same_instruments(first, self.sessions[pair.second].dataset)}
                for pair in self.compared.pairs
            ],
            "not_compared": [unlike.to_json() for unlike in self.compared.unlike],
            "couple": None if self.coupling is None else self.coupling.to_json(),
        }


def gather(names: Sequence[Named], wishes: Wishes, progress: Progress = silent) -> Gathered:
    """Reads and computes everything but the gap. A part that the data do not allow is missing, with
    its reason; InputError only for files that cannot be read."""
    # what is wrong with a file shows before long work
    loaded = load_each([name.path for name in names])
    coupling = _coupling(wishes.couple)
    sessions: list[Session] = []
    for name, dataset in zip(names, loaded, strict=True):
        progress(f"{name.label}: analyzing", 0.3 * len(sessions) / len(names))
        sessions.append(_session(name, dataset))
    return Gathered(
        tuple(sessions),
        compare([(s.dataset, s.analysis) for s in sessions]),
        coupling,
        software_version(),
        wishes.made,
        _coupling_marks(coupling),
    )


def with_gaps(gathered: Gathered, begun: Sequence[Waiting], progress: Progress) -> Gathered:
    """With the diagnosis of every session, or the reason why there is none; waits for them."""
    sessions: list[Session] = []
    for session, wait in zip(gathered.sessions, begun, strict=True):
        progress(f"{session.label}: diagnosing", 0.3 + 0.6 * len(sessions) / len(begun))
        found = wait.result()
        missing = {k: why for k, why in session.missing.items() if k != "diagnose"}
        if not found.json:
            missing["diagnose"] = found.reason
        sessions.append(replace(session, diagnosed=found, missing=missing))
    return replace(gathered, sessions=tuple(sessions))


def _session(name: Named, dataset: Dataset) -> Session:
    """Everything but the gap."""
    path, missing = name.path, dict[str, str]()
    joints = None
    try:
        joints = identify([path])
    except InputError as error:
        missing["identify"] = without_name(str(error), path)
    missing["diagnose"] = TURNED_OFF
    return Session(
        path=path,
        label=name.label,
        stem=name.stem,
        dataset=dataset,
        analysis=analyze(dataset),
        joints=joints,
        diagnosed=Diagnosed(None, reason=TURNED_OFF),
        quality=assess(dataset),
        sha256=_sha256(path),
        from_journal=journal_path(path).exists(),
        missing=missing,
    )


def protocol_summary(dataset: Dataset) -> dict[str, Any] | None:
    """What the protocol asked for, as JSON; None without one, or with one of another version."""
    text = dataset.texts.get("protocol", "")
    if not text.strip() or dataset.path is None:
        return None
    try:
        protocol = parse_protocol(text, dataset.path)
    except InputError:
        return None
    return {
        "repetitions": protocol.repetitions,
        "branches": protocol.branches,
        "order": protocol.order,
        "rate_Hz": protocol.sampling.rate_Hz,
        "samples_per_step": protocol.sampling.samples_per_step,
        "hold_s": protocol.hold_s,
        "rest_s": protocol.rest_s,
        "zero_before_s": protocol.zero.before_s,
        "zero_after_s": protocol.zero.after_s,
        "runs": [
            {
                "pose": run.pose,
                "direction": run.direction,
                "levels": len(run.forces_N),
                "from_N": min(run.forces_N),
                "to_N": max(run.forces_N),
            }
            for run in protocol.runs
        ],
    }


def _sha256(path: Path) -> str:
    """Of the file's bytes; of the journal beside it where that is the truth."""
    journal = journal_path(path)
    try:
        with (journal if journal.exists() else path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}.") from error


def _coupling(model: Path | None) -> CouplingResult | None:
    if model is None:
        return None
    from rig.coupling.couple import couple

    return couple(model)


def _coupling_marks(coupling: CouplingResult | None) -> tuple[str, ...]:
    """Banners of the data that a model was identified from."""
    if coupling is None:
        return ()
    from rig.coupling.coupling_figures import marks_of_notes

    return tuple(marks_of_notes([coupling.model.note]))
