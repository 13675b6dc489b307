"""Model files with anything in them end in a result or in one message, never otherwise."""

from __future__ import annotations

import json
import random
import re
import warnings
from pathlib import Path

import pytest

from rig.coupling.couple import couple
from rig.errors import InputError
from rig.models.robot import MODELS
from rig.models.simulate import simulate

PAPER_XY = Path(__file__).parents[2] / "protocols" / "paper_xy.yaml"
F1 = (MODELS / "F1.yaml").read_text() + (
    "link_segments: robot\nmounting: {tilt_Nm_per_rad: 5e5, turn_Nm_per_rad: 5e5}\n"
)
F2 = (
    (MODELS / "F2.yaml")
    .read_text()
    .replace("kind: rigid", "kind: {beam: {material: steel, diameter_mm: 30, half_length_mm: 50}}")
)
VALUES = (
    "0",
    "-1",
    "1e-300",
    "1e300",
    "nan",
    ".inf",
    "-.inf",
    "abc",
    "[]",
    "{}",
    "null",
    "true",
    "1e9",
    "-1e9",
    "1e-9",
    '""',
    "[1,2,3]",
    "[0,0,0]",
    "90",
    "180",
    "360",
)
_PLACE = re.compile(r"(?<=[\[ ,])-?\d[\d.e+-]*|(?<=: )\w+")


def damaged(rng: random.Random) -> str:
    text = rng.choice([F1, F2])
    for _ in range(rng.choice([1, 1, 2])):
        place = rng.choice(list(_PLACE.finditer(text)))
        text = text[: place.start()] + rng.choice(VALUES) + text[place.end() :]
    return text


@pytest.mark.parametrize("seed", range(4))
def test_damaged_models(seed: int, tmp_path: Path) -> None:
    rng, path = random.Random(seed), tmp_path / "m.yaml"
    refused: list[str] = []
    for _ in range(12):
        path.write_text(damaged(rng))
        for command in (lambda: couple(path, samples=0), lambda: simulate(path, PAPER_XY)):
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                try:
                    result = command()
                except InputError as error:
                    refused.append(str(error))
                    continue
                json.dumps(result.to_json(), allow_nan=False)
                assert result.to_text()
    assert len(refused) > 5
    assert all(message.startswith(str(path)) for message in refused)
