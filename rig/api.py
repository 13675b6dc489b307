"""The same as the commands, for notebooks and scripts.

    import rig

    run = rig.load("run.h5")
    run.curves()
    run.analyze().stiffness
    run.diagnose().probabilities

Every answer holds the result as JSON (`json`), the text of the command (`text`) and tables. What
comes from simulated devices or an incomplete measurement says so wherever it is printed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rig.showing import Table
from rig.storage.files import legible

if TYPE_CHECKING:
    import pandas as pd

    from rig.dataset import Dataset

_NO_PARAMETER: dict[str, Any] = {"value": None, "ci95": [None, None], "unit": ""}


def load(path: str | Path) -> Run:
    """The data set of a file (or of the journal beside it). InputError for anything wrong."""
    from rig.dataset import load as load_dataset

    return Run(load_dataset(Path(path)))


def find(folder: str | Path = ".", *, analyze: bool = False) -> Table:
    """The data sets in a folder and below it, as `rig list` shows them. InputError if there is no
    such folder. analyze: k is computed where it is not known yet."""
    from rig.listing import list_folder

    found = list_folder(Path(folder), analyze=analyze)
    names = ("file", "created", "robot", "directions", "k N/mm", "verdict", "samples", "state")
    rows = [
        (
            e.file,
            e.summary.created,
            e.summary.robot,
            " ".join(e.summary.directions),
            None if e.stiffness is None else e.stiffness_text,
            None if e.verdict is None else e.verdict["word"],
            e.summary.rows,
            e.state,
        )
        for e in found.entries
    ]
    return Table.of_rows(names, rows, title=f"Data sets in {folder}", banners=found.banners())


class Answer:
    """What a command found. result: its own type; json: schema of the command; text: what it
    prints; tables: by name, also as attributes (`answer.curves`)."""

    tables: dict[str, Table]

    def __init__(self, result: Any, headline: str, draw: Callable[[Path], list[Path]]) -> None:
        self.result = result
        self.headline = headline
        self.json: dict[str, Any] = result.to_json()
        self.banners: tuple[str, ...] = tuple(result.banners)
        self.tables = {}
        self._draw = draw

    @property
    def text(self) -> str:
        """What the command prints."""
        return str(self.result.to_text())

    def figures(self, folder: str | Path) -> list[Path]:
        """Draws the figures of the command into a folder; the files written. InputError if the
        folder can't be written to."""
        return self._draw(Path(folder))

    def _add(self, name: str, title: str, names: Sequence[str], rows: Sequence[Any]) -> None:
        self.tables[name] = Table.of_rows(names, rows, title=title, banners=self.banners)

    def __getattr__(self, name: str) -> Table:
        tables = self.__dict__.get("tables", {})
        if name in tables:
            found: Table = tables[name]
            return found
        raise AttributeError(f"{name}; tables here: {', '.join(tables)}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.tables]

    def __repr__(self) -> str:
        return "\n".join([*self.banners, self.headline, f"Tables: {', '.join(self.tables)}"])

    def _repr_html_(self) -> str:
        from html import escape

        top = "".join(f"<p><b>{escape(line)}</b></p>" for line in self.banners)
        plain = (Table(t._columns, title=t.title) for t in self.tables.values())
        return f"{top}<p>{escape(self.headline)}</p>" + "".join(t._repr_html_() for t in plain)


class Run:
    """One measuring session, or one imported table."""

    _SHOWN: ClassVar = ("title", "created", "origin", "software")

    def __init__(self, dataset: Dataset) -> None:
        """dataset: as `rig.dataset.load` gives it."""
        self.dataset = dataset
        self.name = legible(dataset.path.name) if dataset.path else dataset.uuid
        self.banners = dataset.banners()

    def __repr__(self) -> str:
        return repr(self._about())

    def _repr_html_(self) -> str:
        return self._about()._repr_html_()

    def _about(self) -> Table:
        d = self.dataset
        used = int(d.used.sum())
        rows = [(key, getattr(d, key)) for key in self._SHOWN if getattr(d, key)]
        rows += [
            ("robot", d.meta.robot),
            ("poses", ", ".join(d.meta.poses)),
            ("directions", ", ".join(d.meta.directions)),
            ("samples", f"{used} in use of {d.rows}"),
        ]
        return Table.of_rows(("", self.name), [r for r in rows if r[1]], banners=self.banners)

    def samples(self) -> pd.DataFrame:
        """The samples in use, one row each, all columns; units stand in the names."""
        import pandas as pd

        used = self.dataset.used
        return pd.DataFrame({k: v[used] for k, v in self.dataset.columns.items()})

    def curves(self) -> Table:
        """Mean displacement at every level, per direction; `analyze().curves`."""
        return self.analyze().tables["curves"]

    def analyze(
        self,
        *,
        weighting: str = "auto",
        intercept: bool | None = None,
        errors_in_variables: bool = False,
        keep_after_knee: bool = False,
    ) -> Answer:
        """As `rig analyze`; tables: stiffness, curves, pointwise, uncertainty. InputError for a
        weighting that is not known."""
        from rig.analysis import analyze as analysis
        from rig.analysis.analyze_text import answer
        from rig.analysis.figures import draw

        options = analysis.Options(
            analysis.weighting(weighting), intercept, errors_in_variables, keep_after_knee
        )
        result = analysis.analyze(self.dataset, options)
        if options == analysis.Options():
            self._remember(result)
        out = Answer(result, answer(result), lambda folder: draw(result, folder))
        _analysis_tables(out)
        return out

    def identify(self, *others: Run | str | Path, proposals: int = 6) -> Answer:
        """As `rig identify`, from this and other data sets together; tables: joints, next_poses."""
        from rig.analysis.identify import identify

        paths = [self._path(), *(o._path() if isinstance(o, Run) else Path(o) for o in others)]
        result = identify(paths, proposals=proposals)
        out = Answer(result, _first(result.to_text(), result.banners), _no_figures)
        _joint_tables(out)
        return out

    def diagnose(
        self,
        *,
        model: str | Path | None = None,
        simulation: str | Path | None = None,
        add: Iterable[str] = (),
        withhold: Iterable[str] = (),
    ) -> Answer:
        """As `rig diagnose`; tables: probabilities, effects, gap, remainder."""
        from rig.diagnosis.diagnose import diagnose
        from rig.diagnosis.gap_figures import draw

        add, withhold = tuple(add), tuple(withhold)
        result = diagnose(
            self.dataset,
            model=None if model is None else Path(model),
            simulation=None if simulation is None else Path(simulation),
            add=add,
            withhold=withhold,
        )
        if not (model or simulation or add or withhold):
            self._remember(result)
        headline = _first(result.to_text(), result.banners)
        out = Answer(result, headline, lambda folder: draw(result, folder, self.name))
        _gap_tables(out)
        return out

    def _remember(self, result: Any) -> None:
        """For `rig list`, as the command does."""
        from rig.catalogue import remember_result

        if self.dataset.path is not None:
            remember_result(self.dataset.path, result.to_json())

    def _path(self) -> Path:
        from rig.errors import InputError

        if self.dataset.path is None:
            raise InputError(f"{self.name}: not in a file yet; write it with rig.dataset.write.")
        return self.dataset.path


def _no_figures(_: Path) -> list[Path]:
    return []


def _first(text: str, banners: Sequence[str]) -> str:
    """First paragraph of a command's text behind its banners, on one line."""
    lines = [line for line in text.splitlines() if line not in banners]
    start = next((i for i, line in enumerate(lines) if line), 0)
    out = []
    for line in lines[start:]:
        if not line or line.startswith("  "):
            break
        out.append(line)
    return " ".join(out)


def _analysis_tables(out: Answer) -> None:
    directions = out.json["directions"]
    k = [(key, d, d["stiffness_N_per_mm"]) for key, d in directions.items()]
    out._add(
        "stiffness",
        "Stiffness k",
        ("direction", "pose", "k_N_per_mm", "u_N_per_mm", "ci95_low", "ci95_high", "weighting"),
        [
            (key, d["pose"], q["value"], q["standard_uncertainty"], *q["ci95"], d["weighting"])
            for key, d, q in k
        ],
    )
    tables = (
        (
            "curves",
            "curve",
            "Means over the repetitions",
            ("branch", "step", "force_N", "displacement_mm", "sd_mm", "n"),
        ),
        (
            "pointwise",
            "pointwise",
            "Stiffness between neighbouring levels",
            ("force_N", "stiffness_N_per_mm", "sd_N_per_mm", "n"),
        ),
        (
            "uncertainty",
            "budget",
            "Uncertainty of k",
            ("name", "type", "standard_uncertainty_N_per_mm", "degrees_of_freedom", "counted"),
        ),
    )
    for name, key, title, columns in tables:
        rows = [(d, *(row[c] for c in columns)) for d in directions for row in directions[d][key]]
        out._add(name, title, ("direction", *columns), rows)


def _joint_tables(out: Answer) -> None:
    found = out.json
    rows = [
        (j + 1, q["value"], q["standard_uncertainty"], *q["ci95"], identified, max(share, 0.0))
        for j, (q, identified, share) in enumerate(
            zip(
                found["joint_stiffness_Nm_per_rad"],
                found["identified"],
                found["share_of_data"],
                strict=True,
            )
        )
    ]
    names = (
        "joint",
        "c_Nm_per_rad",
        "u_Nm_per_rad",
        "ci95_low",
        "ci95_high",
        "identified",
        "share_of_data",
    )
    out._add("joints", "Joint torsional stiffness", names, rows)
    proposals = [
        (", ".join(f"{q:.3f}" for q in p["q_rad"]), str(p["direction"]), p["force_N"], p["why"])
        for p in found["next_poses"]
    ]
    out._add(
        "next_poses", "What to measure next", ("q_rad", "direction", "force_N", "why"), proposals
    )


def _gap_tables(out: Answer) -> None:
    from identification.gap.answer.remainder import remainder
    from rig.diagnosis.gap_points import held_table, remainder_table, shown

    found, r = out.json, out.result.result
    ranked = sorted(found["probabilities"].items(), key=lambda item: -item[1])
    out._add("probabilities", "Of being the main cause", ("word", "probability"), ranked)
    rows = [
        (
            e["name"],
            e["probability"],
            e["share_of_gap"],
            name,
            p["value"],
            *p["ci95"],
            p["unit"],
            ", ".join(e["indistinguishable_from"]),
        )
        for e in found["effects"]
        for name, p in (e["parameters"] or {"": _NO_PARAMETER}).items()
    ]
    names = (
        "effect",
        "probability",
        "share_of_gap",
        "parameter",
        "value",
        "ci95_low",
        "ci95_high",
        "unit",
        "indistinguishable_from",
    )
    out._add("effects", "Effects in the explanation", names, rows)
    for name, title, table in (
        ("gap", "How far the gap shrinks", held_table(shown(r))),
        ("remainder", "What remains", remainder_table(shown(r), remainder(r.engine, r.fit))),
    ):
        columns = {key: list(values) for key, values in table.items()}
        out.tables[name] = Table(columns, title=title, banners=out.banners)
