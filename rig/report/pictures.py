"""The figures of a report with the numbers behind them, each under a name of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from rig.analysis import figures as analysis_figures
from rig.analysis.analyze import Analysis
from rig.report import figures, setup_drawing
from rig.report.compare import aligned
from rig.report.document import Figure
from rig.report.drawing import draw
from rig.report.gather import Gathered, Session
from rig.report.setup_drawing import Load
from rig.report.wishes import file_stem

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

MOST_CURVES = 4  # in one figure; with more, each pose has its own
Rows = tuple[tuple[object, ...], ...]


@dataclass
class Pictures:
    """png: draw as PNG too, for files. Names are unique within one `Pictures`."""

    png: bool = False
    _taken: set[str] = field(default_factory=set)
    _drawn: dict[str, Figure] = field(default_factory=dict)

    def again(self) -> Pictures:
        """For the same document once more: what was drawn is not drawn again."""
        return Pictures(self.png, _drawn=self._drawn)

    def setup(self, session: Session, pose: str, loads: Sequence[Load]) -> Figure:
        """The arm in one pose with its directions of load; a rig without an arm: its springs."""
        meta = session.dataset.meta
        marked = partial(figures.watermark, banners=session.dataset.banners(), name=session.label)
        header: tuple[str, ...] = ("point", "x_mm", "y_mm", "z_mm")
        rows: Rows
        if meta.poses:
            points = setup_drawing.arm_points(meta, meta.poses[pose])
            names = ("base", *(f"frame {i}" for i in range(1, 6)), "flange", "point of load")
            rows = tuple((n, *map(float, p)) for n, p in zip(names, points, strict=True))
            sign = setup_drawing.laser_sign(session.dataset.calibration)
            seen = "how displacement counts" if sign is None else "from where the laser looks"
            words = f"The arm in pose {pose}: where the screw pushes and {seen}."
            draw = partial(setup_drawing.arm_setup, meta, pose, loads, sign)
            plot: Callable[[], Plot] = lambda: marked(draw())  # noqa: E731
        else:
            header = ("direction", "x", "y", "z")
            rows = tuple((one.name, *one.vector) for one in loads)
            words = "One spring a direction: force and displacement are taken along it."
            plot = lambda: marked(setup_drawing.bench_setup(loads))  # noqa: E731
        caption = f"{words} Distances of screw and laser are schematic."
        return self._draw(
            f"setup_{pose}" if pose else "setup", session, caption, words, plot, header, rows
        )

    def curves(self, session: Session) -> Iterator[Figure]:
        """Displacement over force with standard deviations, as the published Figure 6."""
        header = ("direction", "branch", "step", "force_N", "displacement_mm", "sd_mm", "n")
        for name, part in _parts(session.analysis):
            rows = tuple(
                (
                    key,
                    p["branch"],
                    p["step"],
                    p["force_N"],
                    p["displacement_mm"],
                    p["sd_mm"],
                    p["n"],
                )
                for key, d in part.to_json()["directions"].items()
                for p in d["curve"]
            )
            caption = (
                "Displacement over force: means over the repetitions with their standard "
                "deviation; dashed: the line of k; crosses: levels that do not count towards it."
            )
            yield self._draw(
                f"curve{name}",
                session,
                caption,
                "Displacement over force.",
                partial(analysis_figures.curve, part),
                header,
                rows,
            )

    def pointwise(self, session: Session) -> Iterator[Figure]:
        """Stiffness between neighbouring levels, as the published Figure 7."""
        header = ("direction", "force_N", "stiffness_N_per_mm", "sd_N_per_mm", "n")
        for name, part in _parts(session.analysis):
            rows = tuple(
                (key, p["force_N"], p["stiffness_N_per_mm"], p["sd_N_per_mm"], p["n"])
                for key, d in part.to_json()["directions"].items()
                for p in d["pointwise"]
            )
            if not rows:
                continue
            caption = (
                "Stiffness between neighbouring levels: mean and standard deviation over the "
                "repetitions; dashed: k."
            )
            yield self._draw(
                f"pointwise{name}",
                session,
                caption,
                "Pointwise stiffness.",
                partial(analysis_figures.pointwise, part),
                header,
                rows,
            )

    def joints(self, sessions: Sequence[Session]) -> Figure:
        """Joint stiffnesses of one or several data sets beside the prior."""
        sets = [(s.label, s.joints.to_json()) for s in sessions if s.joints is not None]
        header = ("dataset", "joint", "stiffness_Nm_per_rad", "ci95_low", "ci95_high", "identified")
        rows = tuple(
            (label, j, q["value"], *q["ci95"], known)
            for label, result in sets
            for j, (q, known) in enumerate(
                zip(result["joint_stiffness_Nm_per_rad"], result["identified"], strict=True), 1
            )
        )
        caption = (
            "Torsional stiffness of the joints with 95 % intervals; filled: identified to 5 %; "
            "grey: what was believed before."
        )
        only = sessions[0] if len(sessions) == 1 else None
        plot = lambda: figures.joints(sets, _banners(sessions))  # noqa: E731
        return self._draw("joints", only, caption, "Joint stiffnesses.", plot, header, rows)

    def quality(self, session: Session) -> Figure | None:
        """Lateness, zeros and temperatures over the session; None if nothing was recorded."""
        if not figures.quality_recorded(session.dataset, session.quality.zeros):
            return None
        header = ("pose", "direction", "repetition", "time_s", "force_N", "displacement_mm")
        rows = tuple(
            (r.pose, r.direction, r.repetition, p.time, p.force, p.displacement)
            for r in session.quality.zeros
            for p in r.plateaus
        )
        caption = figures.quality_caption(session.dataset, session.quality.zeros)
        plot = partial(figures.quality, session.label, session.dataset, session.quality.zeros)
        return self._draw("quality", session, caption, caption, plot, header, rows)

    def coupling(self, gathered: Gathered) -> Figure:
        """Single and coupled stiffness, as the published Figure 9."""
        from rig.coupling.coupling_figures import stiffness

        result = gathered.coupling
        assert result is not None
        # `$` in a file's name would begin a formula; this figure's axis needs formulas
        plain = replace(result, model=replace(result.model, name=_no_formula(result.model.name)))
        json = result.to_json()
        kinds = {"single": json["single_N_per_mm"], **json["coupled_N_per_mm"]}
        rows = tuple((name, *(k[a] for a in "xyz")) for name, k in kinds.items() if k)
        caption = "Stiffness of one arm and of the coupled pair; bars: standard uncertainties."
        return self._draw(
            "coupling",
            None,
            caption,
            caption,
            lambda: stiffness(plain),
            ("state", "x_N_per_mm", "y_N_per_mm", "z_N_per_mm"),
            rows,
            mathematics=True,
        )

    def compared(self, gathered: Gathered) -> Iterator[Figure]:
        """k of all data sets, then the curves of each direction over each other."""
        sets = [(s.label, s.analysis) for s in gathered.sessions]
        header = ("dataset", "direction", "k_N_per_mm", "ci95_low", "ci95_high")
        rows = tuple(
            (label, key, k["value"], *k["ci95"])
            for label, a in sets
            for key, d in a.to_json()["directions"].items()
            for k in [d["stiffness_N_per_mm"]]
        )
        caption = "k of every data set with its 95 % interval."
        plot = lambda: figures.compared_k(sets, gathered.banners)  # noqa: E731
        yield self._draw("compared_k", None, caption, caption, plot, header, rows)
        header = ("dataset", "branch", "force_N", "displacement_mm", "sd_mm")
        for name, keys in aligned([a for _, a in sets]).items():
            if keys[0] is None or not any(keys[1:]):
                continue
            caption = (
                f"Direction {name}: the curves of the data sets over each other, each with the "
                "standard deviation of its repetitions."
            )
            curves = partial(figures.compared_curves, name, keys, sets, gathered.banners)
            rows = _curve_rows(keys, sets)
            yield self._draw(f"compared_{name}", None, caption, caption, curves, header, rows)

    def _draw(
        self,
        name: str,
        session: Session | None,
        caption: str,
        alt: str,
        plot: Callable[[], Plot],
        header: tuple[str, ...],
        rows: Rows,
        *,
        mathematics: bool = False,
    ) -> Figure:
        stem = self._free(name if session is None else f"{session.stem}_{name}")
        if stem not in self._drawn:
            self._drawn[stem] = draw(
                stem,
                caption,
                alt,
                plot,
                header=header,
                rows=rows,
                png=self.png,
                mathematics=mathematics,
            )
        return self._drawn[stem]

    def _free(self, wanted: str) -> str:
        """A name that is not in use: `x/y` and `x_y` give the same one."""
        base, n = file_stem(wanted), 1
        name = base
        while name.lower() in self._taken:
            n += 1
            name = f"{base}_{n}"
        self._taken.add(name.lower())
        return name


def _parts(analysis: Analysis) -> list[tuple[str, Analysis]]:
    """(suffix, analysis) per figure: all in one, or one a pose where that is too crowded."""
    if len(analysis.directions) <= MOST_CURVES:
        return [("", analysis)]
    poses = dict.fromkeys(d.pose for d in analysis.directions.values())
    parts = []
    for pose in poses:
        mine = {key: d for key, d in analysis.directions.items() if d.pose == pose}
        parts.append((f"_{pose}" if pose else "", replace(analysis, directions=mine)))
    return parts


def _banners(sessions: Sequence[Session]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(b for s in sessions for b in s.dataset.banners()))


def _no_formula(name: str) -> str:
    return name.replace("$", r"\$")


def _curve_rows(keys: Sequence[str | None], sets: Sequence[tuple[str, Analysis]]) -> Rows:
    found: list[tuple[object, ...]] = []
    for (label, analysis), key in zip(sets, keys, strict=True):
        direction: dict[str, Any] = analysis.to_json()["directions"].get(key, {"curve": []})
        found += [
            (label, p["branch"], p["force_N"], p["displacement_mm"], p["sd_mm"])
            for p in direction["curve"]
        ]
    return tuple(found)
