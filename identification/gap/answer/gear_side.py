"""Whether joints are read on the other side of the gear than META states: what a gear deflects by
shows in readings behind it, and in none before it."""

from __future__ import annotations

import numpy as np

from identification.gap.answer.notes import FAULT, REMARK, Note
from identification.gap.model.bench import Bench

# Of what the stated springs turn by: less is read before the gear, and more behind it. A joint that
# yields turns further, and none has five times its stated stiffness.
_BEFORE, _BEHIND = 0.2, 0.5
_PLAIN = 5.0  # times what the readings scatter: so far the joints turn
_ALIKE = 0.5  # of the readings' square is what springs, scaled, explain


def read_elsewhere(bench: Bench) -> tuple[Note, ...]:
    """A note where that is plain."""
    data, rows = bench.data, bench.rows
    if not data.arm or rows.q is None:
        return ()
    lever = np.stack([s.lever for s in data.setups])[rows.setup]
    turned = rows.about_means(lever * data.compliance * rows.measured_force[:, None])
    read = rows.about_means(rows.q)
    square, product, own = (
        float(np.sum(rows.weight[:, None] * a * b))
        for a, b in ((turned, turned), (turned, read), (read, read))
    )
    if not square > 0:
        return ()
    share = product / square
    left = own - share * product
    if data.output_encoder and share < _BEFORE and square > _PLAIN**2 * left:
        text = (
            f"Under load the joints are read to turn by {100 * max(share, 0.0):.0f} % of what "
            "their springs give. Are they read before the gear? Then META states joint_encoder: "
            "motor; until that is clear believe no verdict."
        )
        return (Note(FAULT, text),)
    if not data.output_encoder and share > _BEHIND and product**2 > _ALIKE * square * own:
        text = (
            f"Under load the joints are read to turn by {100 * share:.0f} % of what their springs "
            "give, as readings behind the gear do. If they are, state joint_encoder: output in "
            "META: then they tell joints from what lies outside of them."
        )
        return (Note(REMARK, text),)
    return ()
