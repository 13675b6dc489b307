"""Every table that is keyed by the words of effects holds all of them, or a subset that is named.

A word that one of the tables lacks is missed here, before data show it.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Collection
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import identification.gap
from identification.gap.answer.parameters import parameters
from identification.gap.effects import EFFECTS
from identification.gap.evidence.parts import Part
from identification.gap.laws.effect import declared
from identification.gap.words import DRIFTS, IN_JOINTS, KINDS, NEED_ARM, WORDS
from rig.blind import judge, mujoco_effects
from rig.diagnosis import diagnose_text, gap_keys, gap_path
from rig.diagnosis.gap_forms import FormError, from_entry
from rig.worlds.benches import draw as benches
from rig.worlds.hidden import draw as hidden
from rig.worlds.hidden import textbook
from rig.worlds.hidden import words as drawn
from tests.conformance.effect_benches import OUTSIDE, PAIRS, of

ANSWERS = {"none", "unknown"}

# By where they stand, so that whoever adds a word is told where it lacks.
TABLES = {
    "KINDS in identification/gap/words.py": KINDS,
    "EFFECTS in identification/gap/effects/__init__.py": EFFECTS,
    "GRAMMAR in rig/diagnosis/gap_keys.py": gap_keys.GRAMMAR,
    "MEANING in rig/diagnosis/diagnose_text.py": diagnose_text.MEANING,
    "EFFECTS in rig/worlds/hidden/words.py": drawn.EFFECTS,
    "FORMS in rig/worlds/hidden/joint_laws.py, outer_laws.py or channel_laws.py": (
        set(hidden.FORMS) - ANSWERS
    ),
    # of pose_error rivals makes a fit of its own
    "FORMS in rig/worlds/hidden/textbook.py": {*textbook.FORMS, "pose_error"},
    "FORMS in a module of rig/worlds/benches": (
        (set(benches.FORMS) - ANSWERS) | NEED_ARM | {"load_misalignment"}
    ),
}


def same_words(place: str, found: Collection[str], wanted: Collection[str]) -> None:
    """Fails with the place, and with what lacks there or is too much."""
    lacks, more = sorted(set(wanted) - set(found)), sorted(set(found) - set(wanted))
    twice = sorted(word for word in set(found) if list(found).count(word) > 1)
    said = {"lacks": lacks, "holds beside the words": more, "holds twice": twice}
    assert not any(said.values()), f"{place}: {', '.join(f'{k} {v}' for k, v in said.items() if v)}"


@pytest.mark.parametrize("place", TABLES)
def test_table_holds_every_word(place: str) -> None:
    same_words(place, TABLES[place], WORDS)


def test_of_a_word_that_lacks_the_place_is_told() -> None:
    with pytest.raises(AssertionError, match=r"^A in b\.py: lacks \['w'\], holds twice \['v'\]"):
        same_words("A in b.py", ["v", "v"], ["v", "w"])


def test_effects_come_in_the_order_of_the_words_and_under_their_own() -> None:
    assert tuple(EFFECTS) == WORDS
    assert all(effect.word == word for word, effect in EFFECTS.items())


# --- subsets: a new word goes to one of the two sides ------------------------------------------

ALIKE_WITHOUT_ARM = {  # said in words that speak of no joint and no laser
    "load_misalignment",
    "force_drift",
    "force_scale",
    "thermal_drift",
    "zero_shift",
    "time_lag",
}
NO_HINGE = {  # instruments, drifts and seats, which the other engine has no part for
    "contact_seating",
    "load_misalignment",
    "force_drift",
    "force_scale",
    "displacement_scale",
    "thermal_drift",
    "zero_shift",
    "time_lag",
    "pose_error",
}

# Declarations that an effect may leave empty by mistake: who has none is named.
NO_LENGTH = {  # in newtons, seconds, angles that springs give, or of an instrument
    "link_flexibility",
    "base_compliance",
    "load_misalignment",
    "force_drift",
    "force_scale",
    "displacement_scale",
    "zero_shift",
    "time_lag",
    "pose_error",
    "joint_stiffness_error",
}
EITHER_SIGN = {  # all its numbers, or factors, which stand above zero by themselves
    "joint_nonlinear_stiffness",
    "load_misalignment",
    "force_drift",
    "force_scale",
    "displacement_scale",
    "thermal_drift",
    "zero_shift",
    "pose_error",
    "joint_stiffness_error",
}

HERE = "tests/conformance/test_words.py"
SIDES: dict[str, tuple[Collection[str], set[str], Collection[str]]] = {
    f"_OF_ONE_SPRING in rig/diagnosis/diagnose_text.py or ALIKE_WITHOUT_ARM in {HERE}": (
        diagnose_text._OF_ONE_SPRING,
        ALIKE_WITHOUT_ARM,
        set(WORDS) - NEED_ARM,
    ),
    f"_DRAW in rig/blind/mujoco_effects.py or NO_HINGE in {HERE}": (
        mujoco_effects.EFFECTS,
        NO_HINGE,
        WORDS,
    ),
    f"`lengths` of the effect's EFFECT or NO_LENGTH in {HERE}": (
        [w for w, e in EFFECTS.items() if e.lengths],
        NO_LENGTH,
        WORDS,
    ),
    f"`not_negative` of the effect's EFFECT or EITHER_SIGN in {HERE}": (
        [w for w, e in EFFECTS.items() if e.not_negative],
        EITHER_SIGN,
        WORDS,
    ),
}


@pytest.mark.parametrize("place", SIDES)
def test_word_is_in_the_table_or_named_as_left_out(place: str) -> None:
    some, others, words = SIDES[place]
    same_words(place, [*some, *others], words)


@pytest.mark.parametrize("word", WORDS)
def test_every_effect_says_something_on_some_bench(word: str) -> None:
    """Whether what it says is right, test_known_laws asks."""
    assert names()[word]


def test_words_that_are_scored_beside_the_leading_one_are_refined() -> None:
    assert all(effect.finer is not None for effect in EFFECTS.values() if effect.beside)


def test_laws_that_go_through_springs_name_them_in_model_files() -> None:
    about = {w for w, grammar in gap_keys.GRAMMAR.items() if "about" in grammar.constants}
    assert about == {w for w in WORDS if EFFECTS[w].laws.through_springs}


def test_what_belongs_to_a_session_is_said_to_be_left_out() -> None:
    gone = {w for w in WORDS if not EFFECTS[w].laws.lasts}
    same_words("_OF_SESSIONS in rig/diagnosis/gap_path.py", gap_path._OF_SESSIONS, gone)
    chance = {c for w in WORDS if w not in gone for c in EFFECTS[w].laws.of_session}
    same_words("_CHANCE in rig/diagnosis/gap_path.py", gap_path._CHANCE, chance)


@pytest.mark.parametrize("word", WORDS)
def test_what_is_of_a_session_is_a_coefficient_of_model_files(word: str) -> None:
    assert {*EFFECTS[word].laws.of_session} <= {c for c, _ in gap_keys.GRAMMAR[word].terms}


def test_both_sides_say_alike_what_joints_show() -> None:
    words = "rig/worlds/hidden/words.py"
    same_words(f"IN_JOINTS in {words}", drawn.IN_JOINTS, IN_JOINTS | {"joint_stiffness_error"})
    outside = f"OUTSIDE in tests/conformance/effect_benches.py beside OUTSIDE_JOINTS in {words}"
    same_words(outside, set(OUTSIDE), drawn.OUTSIDE_JOINTS)


def test_drifts_are_drawn_with_the_clock_that_they_live_on() -> None:
    same_words("ON_THE_CLOCK in rig/worlds/hidden/words.py", drawn.ON_THE_CLOCK, DRIFTS)


@pytest.mark.parametrize("word", WORDS)
def test_laws_of_the_library_are_written_with_the_grammar_of_their_word(word: str) -> None:
    bench, variants, _ = of(word, "rich")
    grammar, laws = gap_keys.GRAMMAR[word], EFFECTS[word].laws
    for law in (laws.of(bench, v)[0] for v in variants):
        assert {*law.constants} <= {*grammar.constants}
        allowed = {(c, frozenset(shape)) for c, shape in gap_keys.kinds(grammar, law.constants)}
        assert {(t.coefficient, frozenset(t.shape)) for t in law.terms} <= allowed, law


@pytest.mark.parametrize(
    ("entry", "wanted"),
    [
        (
            {"name": "force_drift", "path": "root", "terms": [{"drift_N_per_s": 1.0}]},
            "(drift_N_per_sqrt_s) or (along, drift_N_per_sqrt_s).",
        ),
        (
            {
                "name": "joint_hysteresis",
                "joint": 1,
                "law": "Dahl",
                "memory": "kept",
                "terms": [{"friction_Nm": 3.0, "compliance_rad_per_Nm": 1e-6}],
            },
            "(reach_Nm, compliance_rad_per_Nm) or (reach_Nm, grows_with_net_torque_to_Nm, "
            "compliance_rad_per_Nm) or (reach_Nm, grows_with_push_to_Nm, compliance_rad_per_Nm) "
            "or (compliance_rad_per_Nm).",
        ),
    ],
)
def test_terms_of_another_law_of_the_word_are_refused(entry: dict[str, Any], wanted: str) -> None:
    """A path in time or a friction law has terms of its own: others would be misread."""
    with pytest.raises(FormError) as caught:
        from_entry({"quantity": "force"} | entry if "path" in entry else entry)
    assert str(caught.value).endswith(f"; wanted: {wanted}")


# --- names of parameters ------------------------------------------------------------------------


@cache
def names() -> dict[str, set[str]]:
    """Word -> parameters that its shapes have on the benches of the designs."""
    out: dict[str, set[str]] = defaultdict(set)
    for word, design in PAIRS:
        bench, variants, _ = of(word, design)
        kinds = {  # a stand whose axis lies deep enough slides
            (len(v.columns), v.info.get("depth_m", 0.0), *sorted(v.info)): v for v in variants
        }
        for (k, *_), v in kinds.items():
            part = Part(v, v.scales[0])
            out[word] |= set(parameters(bench, part, np.ones(k), np.eye(k)))
    return out


@pytest.mark.parametrize("word", WORDS)
def test_lengths_and_what_is_not_negative_are_parameters_of_their_word(word: str) -> None:
    effect = EFFECTS[word]
    known = names()[word]
    for name in (*effect.lengths, *effect.not_negative):
        assert any(declared(k, (name,)) for k in known), name


# What a name ends with: a direction, a pose and a number across it, or what is counted.
_ENDING = re.compile(r"(_[xyz](_P\d+)?)?(_?(joint|segment|run)?\d+)?$")


@pytest.mark.parametrize("word", WORDS)
def test_what_a_parameter_means_is_told(word: str) -> None:
    page = (Path(__file__).parents[2] / "docs" / "gap.md").read_text("utf-8")
    rows = page.partition("| parameter | meaning |")[2].partition("\n\n")[0].splitlines()
    told = {name for row in rows for name in re.findall(r"`(\w+)`", row.split(" | ")[0])}
    lacks = {_ENDING.sub("", n) for n in names()[word]} - {_ENDING.sub("", n) for n in told}
    assert not lacks, f"the table of parameters in docs/gap.md lacks {sorted(lacks)}"


@pytest.mark.parametrize(("word", "key"), judge.SHARED)
def test_what_is_scored_is_a_parameter_of_its_word(word: str, key: str) -> None:
    stem = judge.SHARED[word, key].split("{")[0].rstrip("123456")  # of directions, or joints
    assert any(n.startswith(stem) for n in names()[word])


def test_no_word_is_misspelt_anywhere_in_the_library() -> None:
    """Rules that speak of single words compare strings: a typo would change probabilities, and
    nothing would say so."""
    for path in sorted(Path(identification.gap.__path__[0]).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                near = get_close_matches(node.value, WORDS, 1, 0.85)
                assert not near or node.value in WORDS, f"{path.name}:{node.lineno} {node.value}"
