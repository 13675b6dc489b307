"""What rows hide of their samples."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.recording.bins import Bins


@pytest.mark.parametrize("samples", [3, 4, 12])
def test_a_line_in_a_row_takes_a_degree_of_freedom(samples: int) -> None:
    """Noise about a line that the other channel tells: mean squares about the row as without it,
    on average; of rows of two samples as of the others."""
    rng, rows = np.random.default_rng(2), 4000
    count = np.where(np.arange(rows) % 2, samples, 2)
    edges = np.concatenate([[0], np.cumsum(count)[:-1]])
    n = int(count.sum())
    other = rng.normal(0, 1, n)
    bins = Bins(n, edges.astype(np.int64), running=True)
    found = bins.scatter(3.0 * other + rng.normal(0, 0.1, n), other)
    for of, k in ((count == samples, samples), (count == 2, 2)):
        assert found[of].mean() == pytest.approx(0.01 * (1 - 1 / k), rel=0.08)


def test_where_the_other_channel_stands_there_is_no_line() -> None:
    rng, rows = np.random.default_rng(2), 4000
    bins = Bins(3 * rows, np.arange(rows, dtype=np.int64) * 3, running=True)
    found = bins.scatter(rng.normal(0, 0.1, 3 * rows), np.zeros(3 * rows))
    assert found.mean() == pytest.approx(0.01 * 2 / 3, rel=0.05)
