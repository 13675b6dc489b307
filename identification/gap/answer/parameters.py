"""Parameters of an effect in words and units, from coefficients and their covariance.

What they mean, whatever shape was fitted, so that shapes can be compared and mixed:

- threshold: of the sharp knee that, loaded once up to the largest load, comes out at the same
  end with the same work (the bilinear curve of equal area, as with push-over curves in FEMA 356);
  of a joint, the net torque there: weights count, and nobody states the tool's. threshold_of_load:
  what the push alone brings then; threshold_of_force: of a stand that slides, the force across;
- slope beyond, creep, change of compliance: against the elastic compliance as it was found, not as
  it was simulated;
- creep_fraction: late share of the elastic deflection in the end, as far as the times of the law
  reach, and of what flows what it does in one run; creep_fraction_of_run: when a load has stood as
  long as a run lasts;
- width: of the whole play, in whose middle the joint rests when its weights are balanced;
- depth (of a seat): at the largest load;
- lag: mean delay; factor: read over true along the straight line through zero.
"""

from __future__ import annotations

from identification.arrays import Array
from identification.gap.effects import EFFECTS
from identification.gap.evidence.parts import Part
from identification.gap.laws.interval import NOMINAL, Coefficients, ComplianceChange, Parameter
from identification.gap.model.bench import Bench


def parameters(
    bench: Bench, part: Part, w: Array, cov: Array, softer: ComplianceChange = NOMINAL
) -> dict[str, Parameter]:
    """Named parameters of one part; units are written out in the result. w (k,), cov (k, k): its
    coefficients and their covariance; softer: what the springs turned out to be."""
    to_actual = part.variant.to_actual_bench
    there = bench if to_actual is None else to_actual(bench)
    return EFFECTS[part.word].parameters(there, part.variant, Coefficients(w, cov, softer))
