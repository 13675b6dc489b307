"""The words for effects: written down on both sides of the blind check, which share no code."""

from __future__ import annotations

from identification.gap.words import NEED_ARM
from identification.gap.words import WORDS as FITTED
from rig.worlds.hidden.words import EFFECTS as DRAWN
from rig.worlds.hidden.words import IN_JOINTS, OUTSIDE_JOINTS
from rig.worlds.hidden.words import WORDS as ANSWERS


def test_what_is_drawn_is_what_is_fitted() -> None:
    assert set(DRAWN) == set(FITTED)
    assert len(set(DRAWN)) == len(DRAWN)
    assert len(set(FITTED)) == len(FITTED)
    assert set(ANSWERS) == {*FITTED, "none", "unknown"}


def test_lists_of_some_words_hold_no_others() -> None:
    for some in (NEED_ARM, IN_JOINTS, OUTSIDE_JOINTS):
        assert set(some) < set(FITTED)
    assert not IN_JOINTS & OUTSIDE_JOINTS
