"""The bundle that is being filled: which robots it waits for, and when it may leave."""

import pytest

from zteam.transforms.process.bundle import PATIENCE, Bundle


def spoken(*robots: int) -> Bundle:
    """A bundle of these robots' first tick that has left."""
    bundle = Bundle()
    for robot_id in robots:
        bundle.take(robot_id, 1, 0.0)
    bundle.close()
    return bundle


def test_a_bundle_is_whole_with_its_last_robot() -> None:
    """Robots that spoke for the tick before are waited for, in any order; the first robot waits for no other. Only
    transforms of a later tick end it, and only while it holds some."""
    assert Bundle().take(4, 1, 0.0)
    bundle = spoken(0, 1, 2)
    assert not bundle.ends_with(2)
    assert [bundle.take(robot_id, 2, 0.0) for robot_id in (2, 0, 1)] == [False, False, True]
    assert [bundle.ends_with(stamp) for stamp in (1, 2, 3)] == [False, False, True]


def test_a_silent_robot_is_not_waited_for_again() -> None:
    """After a late bundle the others' bundles are whole without it, until it speaks again."""
    bundle = spoken(0, 1)
    assert not bundle.take(0, 2, 0.0)
    bundle.forget_silent()
    for robot_id in (0, 1):
        bundle.close()
        assert bundle.take(robot_id, 3, 0.0)
    bundle.close()
    assert not bundle.take(0, 4, 0.0)


def test_a_bundle_grows_old_from_its_first_transform_on() -> None:
    """Later transforms do not make it younger; one that has left has no age."""
    bundle = spoken(0, 1, 2)
    assert not bundle.is_open
    for robot_id in (0, 1):
        bundle.take(robot_id, 2, 10.0 + robot_id * PATIENCE / 2)
    assert bundle.is_open
    assert [bundle.is_old(10.0 + PATIENCE * share) for share in (0.9, 1.1)] == [False, True]
    bundle.close()
    assert not bundle.is_old(99.0)


def test_lockstep_waits_for_every_robot_of_the_world() -> None:
    """A tick is whole when all robots of its world have spoken for it and their fixed transforms have come; what they
    sent for the tick before does not count, and no robot of another world stands in."""
    bundle = Bundle((0, 7))
    for robot_id in (0, 1, 7):
        bundle.take_in_lockstep(robot_id, 1)
    assert [bundle.has_all(robots, 1) for robots in ({0}, {0, 2}, {0, 1})] == [True, False, False]
    bundle.placed.add(1)
    assert bundle.has_all({0, 1}, 1)
    bundle.take_in_lockstep(0, 2, 1)
    bundle.take_in_lockstep(1, 1, 1)
    assert not bundle.has_all({0, 1}, 2)
    assert bundle.begun(1) == 2
    bundle.take_in_lockstep(1, 2, 1)
    assert bundle.has_all({0, 1}, 2)
    assert bundle.begun(2) == 2


def test_a_bundle_of_lockstep_leaves_once() -> None:
    """What comes for a tick whose bundle has left waits for the next one; a robot that is new in the tick does not."""
    bundle = Bundle((0, 1))
    leaves = []
    for robot_id, stamp, robots in ((0, 1, {0}), (0, 1, {0}), (1, 1, {0, 1}), (0, 2, {0, 1}), (1, 2, {0, 1})):
        bundle.take_in_lockstep(robot_id, stamp, 1)
        leaves.append(bundle.leaves(robots))
        bundle.close(leaves[-1] or 0)
    assert leaves == [1, None, 1, None, 2]
    assert bundle.leaves({0, 1}) is None


@pytest.mark.parametrize("forged", [[3], [10**9], [*range(3, 100)]])
def test_other_stamps_of_a_robot_hold_no_tick_of_lockstep(forged: list[int]) -> None:
    """Another process that may write the robot's transforms sends bases of later ticks before the true ones and
    between them: the tick is whole with these."""
    bundle = Bundle((0, 1))
    for robot_id in (0, 1):
        for stamp in forged:
            bundle.take_in_lockstep(1, stamp, 2)
        bundle.take_in_lockstep(robot_id, 2, 2)
    assert bundle.leaves({0, 1}) == 2
    assert sum(bundle.has_all({1}, stamp) for stamp in forged) < 8
