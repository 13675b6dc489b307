"""Does the 95 % interval of the withheld shrink factor cover? Fresh sessions of one rig.

    python bench/interval_of_shrink.py [--sessions 50]

What the interval is of: rms before over rms after on withheld repetitions, expected over sessions.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.gap.effects import library
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.judging.heldout import HeldOut, folds, held_out
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.search.search import search
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import Design, imported, meta, noisy

Array = NDArray[np.float64]
RUN_SCATTER_M = 1e-6


def seating(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """30 um, arctangent of the force."""
    force = rows["force_N"].to_numpy(float)
    return 3e-5 * 2 / np.pi * np.arctan(force / 12.0), np.zeros_like(lever)


def session(design: Design, seed: int) -> HeldOut:
    """Withheld repetitions of one session, judged by the explanation that its search found."""
    rows = noisy(design, seating, seed=seed)
    rng = np.random.default_rng(1000 + seed)
    for mine in rows.groupby(["direction", "repetition"]).indices.values():
        rows.loc[mine, "displacement_mm"] += rng.normal(0, RUN_SCATTER_M * 1e3)
    bench = make_bench(gap_data(imported(rows, meta(design))))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    variants = library(bench, ["contact_seating"])
    engine = Engine(bench, base, target, eta_levels(bench, base, target))
    found = search(engine, variants)
    return held_out(engine, found.explanations[0], "repetition", folds(engine)["repetition"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=50)
    count = parser.parse_args().sessions
    bench = Design(directions=("x",), arm=False, hold=3)
    for name, design in {
        "bench, one direction, 3 repetitions": bench,
        "bench, one direction, 8 repetitions": Design(
            directions=("x",), arm=False, hold=3, repetitions=8
        ),
        "arm, two directions, 3 repetitions": Design(),
    }.items():
        all_held = [session(design, seed) for seed in range(count)]
        before = np.sqrt(np.mean([h.before**2 for h in all_held]))
        after = np.sqrt(np.mean([h.after**2 for h in all_held]))
        true = float(before / after)
        inside = [h.ci95[0] <= true <= h.ci95[1] for h in all_held]
        width = np.median([np.log(h.ci95[1] / h.ci95[0]) for h in all_held])
        scatter = np.std([np.log(h.shrink) for h in all_held])
        print(
            f"{name}: expected {true:.2f}, covered {sum(inside)} of {count}, median width "
            f"{width:.3f} (log), scatter of the factor {scatter:.3f}: width of a right interval "
            f"{3.92 * scatter:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
