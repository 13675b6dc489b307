"""Drawing hidden cases: the same again, as asked for, and in the format that goes out."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from rig.errors import InputError
from rig.meta import Meta
from rig.worlds.hidden import draw
from rig.worlds.hidden.design import draw_plan
from rig.worlds.hidden.draw import WORDS, HiddenCase, draw_case
from rig.worlds.hidden.effect import Effect
from rig.worlds.hidden.scene import Scene, make_scene


@pytest.fixture(scope="module")
def cases() -> list[HiddenCase]:
    """One effect and two, in all three designs."""
    return [draw_case(21, k) for k in (0, 1, 3, 4)]


def test_the_same_seed_and_number_give_the_same_case(cases: list[HiddenCase]) -> None:
    again = draw_case(21, 1)
    assert again.name == cases[1].name
    assert again.label == cases[1].label
    assert again.meta == cases[1].meta
    assert again.columns.keys() == cases[1].columns.keys()
    for name, column in again.columns.items():
        assert np.array_equal(column, cases[1].columns[name])


def test_other_numbers_and_seeds_give_other_cases(cases: list[HiddenCase]) -> None:
    assert len({json.dumps(c.meta) for c in cases}) == len(cases)
    assert draw_case(22, 1).meta != cases[1].meta


def test_labels_are_json_and_meta_is_valid(cases: list[HiddenCase]) -> None:
    for case in cases:
        assert json.loads(json.dumps(case.label)) == case.label
        meta = Meta.model_validate(case.meta)
        names = set(zip(case.columns["pose"], case.columns["direction"], strict=True))
        assert names == {(p, d) for p in meta.poses for d in meta.directions}


def test_columns_are_the_contracted_ones_and_of_one_length(cases: list[HiddenCase]) -> None:
    known = {
        "time_s",
        "session_s",
        "pose",
        "direction",
        "repetition",
        "branch",
        "step",
        "force_N",
        "force_x_N",
        "force_y_N",
        "force_z_N",
        "displacement_mm",
        *(f"q{j}_rad" for j in range(1, 7)),
        *(f"temperature{j}_C" for j in range(1, 7)),
    }
    for case in cases:
        assert set(case.columns) <= known
        assert {len(c) for c in case.columns.values()} == {case.label["samples"]}
        recorded = case.label["recorded"]
        assert ("q1_rad" in case.columns) == recorded["q"]
        assert ("force_x_N" in case.columns) == recorded["components"]


def test_clocks_run_forward_and_the_laser_starts_at_zero(cases: list[HiddenCase]) -> None:
    for case in cases:
        run = case.columns["time_s"]
        starts = np.flatnonzero(np.diff(run, prepend=np.inf) < 0)
        assert len(starts) % len(case.meta["directions"]) == 0
        if "session_s" in case.columns:
            assert np.all(np.diff(case.columns["session_s"]) > 0.9)
        assert case.columns["displacement_mm"][0] == 0.0


def test_only_answers_hold_answers(cases: list[HiddenCase]) -> None:
    for case in cases:
        told = json.dumps(case.meta)
        assert not any(word in told for word in WORDS if word not in ("none", "unknown"))


@pytest.mark.parametrize(
    ("word", "snr"),
    [("joint_yield", (8.0, 8.2)), ("time_lag", (2.0, 2.05)), ("zero_shift", (30.0, 31.0))],
)
def test_the_gap_is_as_large_as_asked_for(word: str, snr: tuple[float, float]) -> None:
    case = draw_case(5, 3, word=word, design="medium", snr=snr)
    assert case.label["truth"] == [word]
    assert 0.97 * snr[0] <= case.label["snr"] <= 1.03 * snr[1]


def test_noise_in_the_table_is_what_the_label_says() -> None:
    """Of a case without an effect, six free springs leave the noise, and nothing else."""
    case = draw_case(6, 2, word="none", design="rich")
    moved, force = case.columns["displacement_mm"], case.columns["force_N"]
    columns = []
    setups = list(zip(case.columns["pose"], case.columns["direction"], strict=True))
    for setup in dict.fromkeys(setups):
        mine = np.array([s == setup for s in setups], dtype=float)
        columns += [mine, mine * force]
    matrix = np.stack(columns, axis=1)
    rest = moved - matrix @ np.linalg.lstsq(matrix, moved, rcond=None)[0]
    assert np.sqrt(np.mean(rest**2)) == pytest.approx(case.label["noise_rms_mm"], rel=0.15)
    assert case.label["snr"] == 0.0
    assert case.label["where"] is None


def test_noise_is_as_large_as_stated() -> None:
    for number in range(4):
        case = draw_case(9, number, word="none", design="rich")
        instruments = case.meta["instruments"]
        stated = instruments["displacement"]["standard_uncertainty_mm"]
        force = instruments["force"]["standard_uncertainty_N"]
        # the arm turns a newton of noise into 5 to 40 um
        assert stated * 0.85 < case.label["noise_rms_mm"]
        assert case.label["noise_rms_mm"] < 1.15 * np.hypot(stated, 0.04 * force)


def test_mixtures_hold_both() -> None:
    case = draw_case(7, 1, word="joint_creep", second="zero_shift", design="medium")
    assert case.label["truth"] == ["joint_creep", "zero_shift"]
    assert case.label["verdict"] == "mixture"
    assert len(case.label["accept_each"]) == len(case.label["snr_each"]) == 2
    assert min(case.label["snr_each"]) > 1.0


@pytest.mark.parametrize("laws", ["fitted", "foreign"])
def test_laws_can_be_asked_for(laws: str) -> None:
    for number in range(3):
        case = draw_case(8, number, word="joint_nonlinear_stiffness", design="paper", laws=laws)
        assert case.label["laws"] == [laws]


def test_words_are_mixed_as_planned() -> None:
    drawn = [draw._words(np.random.default_rng([1, k, 0]), None, None) for k in range(3000)]
    kinds = Counter(words[0] if words[0] in ("none", "unknown") else len(words) for words in drawn)
    assert kinds["none"] == pytest.approx(300, abs=60)
    assert kinds["unknown"] == pytest.approx(300, abs=60)
    assert kinds[2] == pytest.approx(600, abs=80)
    single = Counter(words[0] for words in drawn if len(words) == 1)
    assert min(single[w] for w in draw.EFFECTS) > 60
    assert all(len(set(words)) == len(words) for words in drawn)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match='word: "joint_yeild" is not known') as caught:
        draw_case(1, 1, word="joint_yeild")
    assert "joint_yield" in str(caught.value)
    with pytest.raises(InputError, match="second"):
        draw_case(1, 1, word="none", second="joint_yield")
    with pytest.raises(InputError, match="design"):
        draw_case(1, 1, design="poor")


def test_sizes_beyond_physics_are_refused() -> None:
    with pytest.raises(InputError, match="out of reach for contact_seating"):
        draw_case(1, 1, word="contact_seating", design="paper", snr=(4000.0, 5000.0))


def test_nothing_of_identification_is_imported() -> None:
    code = (
        "import sys, rig.worlds.hidden.draw as d; d.draw_case(1, 1, word='none', design='paper');"
        "print([m for m in sys.modules if m.split('.')[0] in ('identification', 'drivers')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.strip() == "[]"


def test_some_hands_turn_past_a_level_and_back() -> None:
    """No sample shows it; what is read is the level."""
    random = np.random.default_rng(5)
    plan = replace(draw_plan(random, "medium"), beyond=0.5)
    history = make_scene(plan, random).history
    load = history.load
    past, levels = 0, np.flatnonzero(np.diff(history.step, prepend=0) != 0)
    for before, at in zip(history.sample[levels - 1], history.sample[levels], strict=True):
        way = load[before : at + 1]
        past += bool(way.max() > max(way[0], way[-1]) or way.min() < min(way[0], way[-1]))
        assert way.min() >= 0.0
    assert 0.3 < past / len(levels) < 0.7
    calm = make_scene(replace(plan, beyond=0.0), random).history
    for before, at in zip(calm.sample[:-1], calm.sample[1:], strict=True):
        way = np.diff(calm.load[before : at + 1])
        assert np.all(way >= 0) or np.all(way <= 0)


@pytest.mark.parametrize("first", ["pose_error", "load_misalignment"])
def test_mechanisms_answer_to_the_torques_that_are_there(
    first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever of the two words is drawn first: what turns the load comes before what answers."""
    seen: list[tuple[str, Scene]] = []
    plain = draw._draw_effect

    def drawn(scene: Scene, random: np.random.Generator, word: str, laws: str | None) -> Effect:
        seen.append((word, scene))
        return plain(scene, random, word, laws)

    monkeypatch.setattr(draw, "_draw_effect", drawn)
    case = draw_case(5, 2, word="joint_yield", second=first)
    assert set(case.label["truth"]) == {"joint_yield", first}
    (word, scene), (second, turned) = seen[-2:]
    assert (word, second) == (first, "joint_yield")
    assert scene.turned is None
    assert turned.turned is not None
    assert np.abs(turned.torque - scene.torque).max() > 0.5
    np.testing.assert_array_equal(turned.elastic, scene.elastic)
    if first == "pose_error":
        assert np.abs(turned.point - scene.tool).max() > 1e-3
    else:
        assert np.abs(turned.force - scene.force).max() > 1.0
