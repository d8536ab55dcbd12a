"""The bundle that is being filled: which robots it waits for, and when it may leave."""

import pytest

from zteam.transforms.process.bundle import PATIENCE, Bundle


def spoken(*robots: int, stamp: int = 1) -> Bundle:
    """A bundle of these robots' tick that has left."""
    bundle = Bundle()
    for robot_id in robots:
        bundle.take(robot_id, stamp, 0.0)
    bundle.close()
    return bundle


def test_the_first_robot_waits_for_no_other() -> None:
    """Robots that have never spoken are unknown, so a first bundle is whole at once."""
    assert Bundle().take(4, 1, 0.0)


def test_a_bundle_is_whole_with_its_last_robot() -> None:
    """Robots that spoke for the tick before are waited for, in any order."""
    bundle = spoken(0, 1, 2)
    assert [bundle.take(robot_id, 2, 0.0) for robot_id in (2, 0, 1)] == [False, False, True]


def test_a_newer_stamp_ends_an_open_bundle() -> None:
    """Only transforms of a later tick end it, and only while it holds some."""
    bundle = spoken(0, 1)
    assert not bundle.ends_with(2)
    bundle.take(0, 2, 0.0)
    assert [bundle.ends_with(stamp) for stamp in (1, 2, 3)] == [False, False, True]


def test_a_silent_robot_is_not_waited_for_again() -> None:
    """After a late bundle the others' bundles are whole without it, until it speaks again."""
    bundle = spoken(0, 1)
    assert not bundle.take(0, 2, 0.0)
    bundle.forget_silent()
    bundle.close()
    assert bundle.take(0, 3, 0.0)
    bundle.close()
    assert bundle.take(1, 3, 0.0)
    bundle.close()
    assert not bundle.take(0, 4, 0.0)


def test_a_robot_that_makes_ticks_up_harms_itself_alone() -> None:
    """Others' words for the tick that comes are kept, however many stamps it names before and after them."""
    bundle = Bundle()
    bundle.placed = {0, 1, 2}
    bundle.take_in_lockstep(0, 100, 1)
    for stamp in (*range(2, 30), *range(200, 230)):
        bundle.take_in_lockstep(2, stamp, 1)
    bundle.take_in_lockstep(1, 100, 1)
    assert bundle.has_all({0, 1}, 100)
    bundle.take_in_lockstep(2, 100, 1)
    assert bundle.has_all({0, 1, 2}, 100)


def test_a_bundle_grows_old_from_its_first_transform_on() -> None:
    """Later transforms do not make it younger; one that has left has no age."""
    bundle = spoken(0, 1, 2)
    assert not bundle.is_open
    bundle.take(0, 2, 10.0)
    bundle.take(1, 2, 10.0 + PATIENCE / 2)
    assert bundle.is_open
    assert not bundle.is_old(10.0 + PATIENCE * 0.9)
    assert bundle.is_old(10.0 + PATIENCE * 1.1)
    bundle.close()
    assert not bundle.is_old(99.0)


def test_lockstep_waits_for_every_robot_of_the_world() -> None:
    """A tick is complete when all its robots have spoken for it; what they sent for the tick before does not count."""
    robots = {0, 1}
    bundle = Bundle(robots)
    for robot_id in robots:
        bundle.take_in_lockstep(robot_id, 1)
    assert bundle.has_all(robots, 1)
    bundle.take_in_lockstep(0, 2, 1)
    assert not bundle.has_all(robots, 2)
    bundle.take_in_lockstep(1, 1, 1)
    assert not bundle.has_all(robots, 2)
    assert bundle.begun(1) == 2
    bundle.take_in_lockstep(1, 2, 1)
    assert bundle.has_all(robots, 2)
    assert bundle.begun(2) == 2


def test_lockstep_counts_the_worlds_own_robots_only() -> None:
    """A robot of another world does not stand in for a missing one."""
    bundle = Bundle((0, 7))
    for robot_id in (0, 7):
        bundle.take_in_lockstep(robot_id, 1)
    assert not bundle.has_all({0, 1}, 1)
    assert bundle.has_all({0}, 1)


def test_lockstep_waits_for_fixed_transforms() -> None:
    """A robot that has spoken keeps the tick open while its start pose is unknown."""
    bundle = Bundle()
    bundle.take_in_lockstep(0, 1)
    assert not bundle.has_all({0}, 1)
    bundle.placed.add(0)
    assert bundle.has_all({0}, 1)


def test_a_bundle_of_lockstep_leaves_once() -> None:
    """What comes for a tick whose bundle has left waits for the next one; a robot that is new in the tick does not."""
    bundle = Bundle((0, 1))
    bundle.take_in_lockstep(0, 1)
    assert bundle.leaves({0}) == 1
    bundle.close(1)
    bundle.take_in_lockstep(0, 1)
    assert bundle.leaves({0}) is None
    bundle.take_in_lockstep(1, 1)
    assert bundle.leaves({0, 1}) == 1
    bundle.close(1)
    bundle.take_in_lockstep(0, 2, 1)
    assert bundle.leaves({0, 1}) is None
    bundle.take_in_lockstep(1, 2, 1)
    assert bundle.leaves({0, 1}) == 2
    bundle.close(2)
    assert bundle.leaves({0, 1}) is None


@pytest.mark.parametrize("forged", [[3], [10**9], [*range(3, 100)]])
def test_other_stamps_of_a_robot_hold_no_tick_of_lockstep(forged: list[int]) -> None:
    """Another process that may write the robot's transforms, such as its localiser, sends bases of later ticks before
    the true ones come and between them: the tick is whole with these, and few others are remembered."""
    bundle = Bundle((0, 1))
    for robot_id in (0, 1):
        for stamp in forged:
            bundle.take_in_lockstep(1, stamp, 2)
        bundle.take_in_lockstep(robot_id, 2, 2)
    assert bundle.has_all({0, 1}, 2)
    assert bundle.leaves({0, 1}) == 2
    assert len(bundle._fresh) <= 8
