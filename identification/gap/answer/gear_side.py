"""Whether joints are read on the other side of the gear than META states, or in another unit or
sense: what a gear deflects by shows in readings behind it, and in none before it."""

from __future__ import annotations

import numpy as np

from identification.gap.answer.notes import FAULT, REMARK, Note
from identification.gap.model.bench import Bench

# Of what the stated springs turn by: less is read before the gear, or is no angle in rad, and more
# behind it. A joint that yields turns further, and few have five times their stated stiffness.
_BEFORE, _BEHIND = 0.2, 0.5
_SURELY = 3.0  # standard deviations of the stated springs
_PLAIN = 5.0  # times what the readings scatter: so far the joints turn
_ALIKE = 0.5  # of the readings' square is what springs, scaled, explain


def read_elsewhere(bench: Bench) -> tuple[Note, ...]:
    """A note where that is plain; or that the readings follow the springs in another sense, or are
    far too small."""
    data, rows = bench.data, bench.rows
    if not data.arm or rows.q is None:
        return ()
    turned = rows.about_means(bench.lever * data.compliance * rows.measured_force[:, None])
    read = rows.about_means(rows.q)
    square, product, own = (
        float(np.sum(rows.weight[:, None] * a * b))
        for a, b in ((turned, turned), (turned, read), (read, read))
    )
    if not square > 0:
        return ()
    share, alike = product / square, product**2 > _ALIKE * square * own
    left = own - share * product
    least = min(_BEFORE, 1 / (1 + _SURELY * float(data.compliance_relative_sd.max())))
    told = (
        f"Under load the joints are read to turn by {round(100 * share)} % of what their springs "
    )
    if data.output_encoder and alike and share < -_BEFORE:
        return (Note(FAULT, f"{told}give: the other way. See to the signs of the readings."),)
    if data.output_encoder and share < least and square > _PLAIN**2 * left:
        why = (
            "give, and in proportion. See to the unit of the readings (rad), and to the stated "
            "stiffnesses; until that is clear believe no verdict."
            if alike
            else "give. Are they read before the gear? Then META states joint_encoder: motor; "
            "until that is clear believe no verdict."
        )
        return (Note(FAULT, told + why),)
    if not data.output_encoder and share > _BEHIND and alike:
        text = (
            f"{told}give, as readings behind the gear do. If they are, state joint_encoder: output "
            "in META: then they tell joints from what lies outside of them."
        )
        return (Note(REMARK, text),)
    return ()
