"""Laws by loops over the rows, beside which nested sampling puts the evidence, are the library's.

The sampling itself takes minutes (tests/recovery/test_nested.py, with -m slow); that its laws still
fit the library is seen here, and the library's operators are checked by others.
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.nested_cases import CASES, case_data
from bench.nested_sampling import MODELS, forms
from identification.gap.effects import library
from identification.gap.model.bench import make_bench


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("word", [m for m in MODELS if m != "none"])
def test_laws_of_the_sampled_route_are_those_of_the_library(case: str, word: str) -> None:
    bench = make_bench(case_data(case))
    found = forms(bench, word, library(bench, [word]))
    assert len(found) >= 7
    for form in found:
        columns = np.column_stack([bench.columns[c] for c in form.variant.columns])
        assert form.columns.shape == columns.shape, form.variant.label
        size = np.abs(columns).max()
        assert np.abs(form.columns - columns).max() < 1e-9 * size, form.variant.label
