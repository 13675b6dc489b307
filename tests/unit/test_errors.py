"""Hints at what was probably meant."""

from __future__ import annotations

from rig.errors import close_to, did_you_mean


def test_the_nearest_word_is_named_or_all_are() -> None:
    words = ("joint_yield", "base_slip")
    assert did_you_mean("joint_yeld", words) == ' Did you mean "joint_yield"?'
    assert did_you_mean("xyz", words) == " Known: base_slip, joint_yield."
    assert close_to("xyz", words) == ""


def test_of_two_words_as_near_as_each_other_none_is_named() -> None:
    robots = ("ur10e", "ur16e", "ur5e")
    assert did_you_mean("ur11e", robots) == " Known: ur10e, ur16e, ur5e."
    assert did_you_mean("ur10", robots) == ' Did you mean "ur10e"?'


def test_words_are_called_otherwise_than_they_are_compared() -> None:
    files = {"station": "station.yml", "paper": "paper.yaml"}
    assert did_you_mean("stations", files, files.__getitem__) == ' Did you mean "station.yml"?'
    assert did_you_mean("x", files, files.__getitem__) == " Known: paper.yaml, station.yml."


def test_of_no_words_nothing_is_said() -> None:
    assert did_you_mean("x", ()) == ""
