"""Units that are slipped into most often, by what they make of a stiffness in N/mm."""

from __future__ import annotations

from math import log

# Times as stiff as simulated, or so small a part: more is most often another unit. Of 1300
# recordings, of rigs and of their simulations, none was off by more than twenty where the response
# is a line for the most part.
FAR = 50.0
LINE = 0.5  # of its square, that the force explains, from which a response is such a line
# A stiffness is so many times what it is where a column is in these units, not in N and mm.
_UNITS = {
    1e-3: "displacements in um or forces in kN",
    0.0254: "displacements in thousandths of an inch",
    1 / 9.80665: "forces in kgf or daN",
    1 / 4.44822: "forces in lbf",
    10.0: "displacements in cm",
    25.4: "displacements in inches",
    1e3: "displacements in m or forces in mN",
}


def slip(log_factor: float, u_log_factor: float) -> str | None:
    """The unit that would make stiffnesses exp(log_factor) times what they are, within three
    standard uncertainties; None where none does."""
    if abs(log_factor) <= 3 * u_log_factor:
        return None
    nearest = min(_UNITS, key=lambda factor: abs(log(factor) - log_factor))
    return _UNITS[nearest] if abs(log(nearest) - log_factor) <= 3 * u_log_factor else None
