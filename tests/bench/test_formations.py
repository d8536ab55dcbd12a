"""Formations in the real simulator, as the study `robots` measures them, from one start each."""

import math

import numpy as np
import pytest

from studies.formations import (
    RMS,
    SETTLE,
    errors_of,
    run_passage,
    run_slalom,
    starts_of,
)
from zteam.robot.behaviors.formation import slots_of


@pytest.mark.team
def test_a_formation_holds_on_a_slalom() -> None:
    """It is formed within 8 s, stays within 3 cm of its slots, and no robots touch."""
    run = run_slalom("wedge", True, 1, seconds=25.0)
    assert run.settle <= SETTLE
    assert not run.contact
    assert math.sqrt(np.mean(np.square(run.errors))) <= RMS
    assert len(run.errors) > 150


@pytest.mark.team
def test_a_formation_squeezes_through_a_passage_and_opens_again() -> None:
    """A line that is 3.2 m wide goes through a passage of 1 m without a touch, and is a line again after it."""
    run = run_passage("line", True, 1, seconds=50.0)
    assert not run.contact
    assert 0.0 < run.aside < 0.3
    assert run.back < 10.0


def test_errors_are_distances_from_the_slots() -> None:
    """Robots in their slots have none; one that is 10 cm beside its slot has that, on the straight and in a bend."""
    back, lateral = np.array(slots_of("wedge", 4, 0.8)).T
    ticks = np.arange(200) * 0.04
    for radius in (1e6, 4.0):
        turned = np.concatenate([[0.0], back])
        along = (ticks[:, None] - turned) / radius
        off = np.concatenate([[0.0], lateral + np.array([0.0, 0.1, 0.0, 0.0])])
        poses = np.stack([(radius - off) * np.sin(along), radius - (radius - off) * np.cos(along), along], axis=2)
        # The trail begins at the first tick, and is straight before it.
        errors = errors_of(poses, "wedge")[100:]
        assert errors == pytest.approx(np.tile([0.0, 0.1, 0.0, 0.0], (100, 1)), abs=0.01)


def test_starts_are_random_and_apart() -> None:
    """Every seed gives other poses behind the leader, no two nearer than 0.8 m, and the same ones again."""
    assert starts_of(3) == starts_of(3)
    assert starts_of(3)[1:] != starts_of(4)[1:]
    for seed in range(20):
        poses = starts_of(seed)
        assert len(poses) == 5
        assert all(pose.x <= 0.0 for pose in poses)
        assert all(math.dist(a[:2], b[:2]) >= 0.8 for i, a in enumerate(poses) for b in poses[:i])
