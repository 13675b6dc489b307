"""Arm segments bend and twist: beams in series with the joints, unseen by encoders.

A load at the tool bends a segment by moments that grow in proportion along it, so that what any
distribution of stiffness along it gives is a sum of squares of the moment at its two ends and in
its middle; of an even tube by Simpson's rule, which is exact then. Coefficients: 1 is the nominal
aluminium tube, 50 to 870 um at 100 N; castings are 0.2 to 3 times it, thin ones 6 times.
No data sheet says where a casting's neutral axis runs: where the model file has the tube, beside
the plane of the joints, or from joint to joint.

Size: 0.2 to 6 times the nominal tubes: 50 to 870 um at 100 N and more.
Prior: factors positive and alike in one segment, sd out of SCALES, equally likely.
Source: beam theory for the segments in the robot's model file.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "link_flexibility"
SCALES = (0.15, 0.5, 1.5, 5.0)


BENDING = {"bending at start": 1 / 6, "bending in the middle": 4 / 6, "bending at end": 1 / 6}
STRAINS = (*BENDING, "twist")
PLACED = ("as modelled", "joint to joint")
ALIKE = 0.7  # correlation of all of them in one segment: they go with its wall and material


def variants(bench: Bench) -> list[Variant]:
    """Each link, and both, wherever they may run."""
    links = np.stack([s.links for s in bench.data.setups])[bench.rows.setup]  # (n, 2, l, 4)
    out = []
    for k, placed in enumerate(PLACED):
        if k and np.allclose(links[:, k], links[:, 0], rtol=1e-6, atol=0.0):
            break
        out += _placed(bench, links[:, k], placed)
    return out


def _placed(bench: Bench, links: Array, placed: str) -> list[Variant]:
    """Of links (n, l, 4) m/N."""
    count, each = links.shape[1:]
    root = np.asarray(np.linalg.cholesky((1 - ALIKE) * np.eye(each) + ALIKE), dtype=float)
    columns = [
        bench.add(bench.outside_column(links[:, k, i] * bench.load))
        for k in range(count)
        for i in range(each)
    ]
    where = "" if placed == PLACED[0] else f" {placed}"
    out = [
        variant(
            WORD,
            f"segment {k + 1}{where}",
            columns[each * k : each * (k + 1)],
            SCALES,
            root=root,
            each=True,
            segments=[k],
            placed=placed,
        )
        for k in range(count)
    ]
    if count > 1:
        both = np.kron(np.eye(count), root).astype(float)
        out.append(
            variant(
                WORD,
                f"both arms{where}",
                columns,
                SCALES,
                root=both,
                each=True,
                form="both",
                segments=list(range(count)),
                placed=placed,
            )
        )
    return out


def _parameters(_: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Of bending the mean along the segment, as an even tube has it."""
    shares = {"bending": [*BENDING.values(), 0.0], "twist": [*np.zeros(len(BENDING)), 1.0]}
    out, segments = {}, v.info["segments"]
    for i, k in enumerate(segments):
        for strain, share in shares.items():
            f = np.zeros((len(segments), len(STRAINS)))
            f[i] = share
            key = f"{strain}_compliance_over_nominal_segment{k + 1}"
            out[key] = found.linear(f.ravel(), "1")
    return out


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: segments, how they strain, as multiples of the nominal tube of the robot file."""
    terms = tuple(
        Term("over_nominal", {"segment": int(k), "strain": strain})
        for k in v.info["segments"]
        for strain in STRAINS
    )
    return Law({"placed": v.info["placed"]}, terms), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Compliance of the segment along the direction times the load."""
    place = PLACED.index(law.constants.get("placed", PLACED[0]))
    each = np.stack([s.links[place] for s in bench.data.setups])[bench.rows.setup]
    most = max(t.shape["segment"] for t in law.terms)
    if most >= each.shape[1]:
        raise ValueError(
            f"link_flexibility of segment {most + 1}: the robot has {each.shape[1]} of them"
        )
    return [
        bench.outside_column(
            each[:, t.shape["segment"], STRAINS.index(t.shape["strain"])] * bench.load
        )
        for t in law.terms
    ]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns),
    lengths=(),
    finer=None,
    not_negative=("bending_compliance_over_nominal", "twist_compliance_over_nominal"),
)
