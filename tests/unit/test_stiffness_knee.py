"""Knees: found where an arm gives way, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.knee import Samples, find_knee, locate

LEVELS_X = np.arange(20.0, 221.0, 20.0)
LEVELS_Y = np.array([7.5, 15, 22.5, 30, 37.5, 45, 52.5, 60, 67.5, 75, 78, 82])
SMOOTH = {
    "straight": lambda f: f / 9e4,
    "softening 133 to 49 N/mm": lambda f: f / 133e3 * (1 + f / 256.0),
    "softening, sinh": lambda f: np.sinh(f / 120.0) * 120.0 / 133e3,
    "softening, exponential": lambda f: np.expm1(f / 100.0) / 1.33e3,
    "saturating": lambda f: f / 133e3 / (1 - f / 300.0),
    "saturating, logarithm": lambda f: -np.log(1 - f / 240.0) * 1e-3,
    "cubic": lambda f: f / 133e3 * (1 + (f / 200.0) ** 2),
    "from zero stiffness": lambda f: np.sqrt(f) / 1e4,
    "power": lambda f: f**1.5 / 1e6,
}


def samples(force: Array, displacement: Array, *, scale: float = 1.0) -> Samples:
    n = force.size
    u_force, u_displacement = np.full(n, 0.11), np.full(n, 2.3e-6 * scale)
    return Samples(force, displacement * scale, u_force, u_displacement, origin=True)


def giving_way(force: Array, after: float = 1250.0) -> Array:
    return np.where(force < 75.0, force / 57420.0, 75.0 / 57420.0 + (force - 75.0) / after)


def noisy(law: object, levels: Array, seed: int) -> Samples:
    random = np.random.default_rng(seed)
    force = levels + random.normal(0.0, 0.4, levels.size)  # the hand's aim
    slack = random.choice([0.2e-6, 1e-6, 2e-6])
    displacement = law(force) * (1 + 0.005 * random.normal())  # type: ignore[operator]
    displacement += random.normal(0.0, slack, levels.size)
    return samples(force + random.normal(0.0, 0.04, levels.size), displacement)


def test_the_published_knee() -> None:
    knee = find_knee(samples(LEVELS_Y, giving_way(LEVELS_Y)))
    assert knee is not None
    assert knee.force == pytest.approx(75.0, abs=0.01)
    assert knee.displacement == pytest.approx(75.0 / 57420.0, rel=1e-4)
    assert knee.k_before == pytest.approx(57420.0, rel=1e-4)
    assert knee.k_after == pytest.approx(1250.0, rel=1e-3)


def test_the_knee_between_levels_is_found_within_half_a_newton() -> None:
    forces = []
    for seed in range(60):
        knee = find_knee(noisy(giving_way, LEVELS_Y, seed))
        assert knee is not None
        forces.append(knee.force)
    assert np.max(np.abs(np.array(forces) - 75.0)) < 0.5


def test_a_level_that_did_not_move_is_one_like_others() -> None:
    levels = np.append(0.0, LEVELS_Y)
    with np.errstate(all="raise"):
        knee = find_knee(replace(samples(levels, giving_way(levels)), origin=False))
    assert knee is not None
    assert knee.force == pytest.approx(75.0, abs=0.01)


def test_a_force_that_stalls_is_a_knee_too() -> None:
    displacement = np.append(np.arange(1.0, 9.0) * 1e-4, [1.5e-3, 2.5e-3, 3.5e-3])
    force = np.minimum(displacement, 8e-4) * 1e5
    knee = find_knee(samples(force, displacement))
    assert knee is not None
    assert knee.force == pytest.approx(80.0, abs=0.1)
    assert abs(knee.k_after) < 10.0


def test_units_do_not_matter() -> None:
    small = find_knee(samples(LEVELS_Y, giving_way(LEVELS_Y), scale=1e-4))
    assert small is not None
    assert small.displacement == pytest.approx(75.0 / 57420.0 * 1e-4, rel=1e-4)


def test_the_slope_must_fall_to_half() -> None:
    """A mild change of slope is reported by the pointwise stiffness, not as a knee."""
    assert find_knee(samples(LEVELS_Y, giving_way(LEVELS_Y, after=0.6 * 57420.0))) is None
    stiffening = giving_way(LEVELS_Y, after=4.0 * 57420.0)
    assert find_knee(samples(LEVELS_Y, stiffening)) is None


def test_too_few_levels_say_nothing() -> None:
    assert find_knee(samples(LEVELS_Y[-4:], giving_way(LEVELS_Y)[-4:])) is None


def test_an_unsteady_displacement_says_nothing() -> None:
    assert find_knee(samples(LEVELS_Y, giving_way(LEVELS_Y)[::-1])) is None


def test_a_bend_before_the_knee_does_not_move_it() -> None:
    def bent(f: Array) -> Array:
        before = f / 60e3 * (1 + f / 300.0)
        knee = 75.0 / 60e3 * 1.25
        return np.where(f < 75.0, before, knee + (f - 75.0) / 1250.0)

    knee = find_knee(samples(LEVELS_Y, bent(LEVELS_Y)))
    assert knee is not None
    assert knee.force == pytest.approx(75.0, abs=0.3)


def test_a_run_of_its_own_places_the_knee_near_that_of_the_mean() -> None:
    knee = find_knee(samples(LEVELS_Y, giving_way(LEVELS_Y)))
    assert knee is not None
    own = locate(samples(LEVELS_Y, 1.01 * giving_way(LEVELS_Y)), knee)
    assert own is not None
    assert own.displacement == pytest.approx(1.01 * knee.displacement, rel=1e-3)


def alarms(draws: int) -> dict[str, int]:
    return {
        name: sum(find_knee(noisy(law, LEVELS_X, seed)) is not None for seed in range(draws))
        for name, law in SMOOTH.items()
    }


def test_no_alarm_on_smooth_curves() -> None:
    assert alarms(10) == dict.fromkeys(SMOOTH, 0)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_false_alarms_stay_below_one_percent() -> None:
    found = alarms(1000)
    assert all(count < 10 for count in found.values()), found
