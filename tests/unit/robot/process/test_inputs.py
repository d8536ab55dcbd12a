"""What has come for one robot, and when a tick is complete."""

import pytest

from support.transforms import S, laser_on, stamped
from zteam.geometry import Pose2
from zteam.messages import (
    BaseInfo,
    Header,
    LaserScan,
    Odometry,
    TFMessage,
    time_from_ns,
)
from zteam.robot.process.inputs import RobotInputs, TransformInputs


def give(inputs: RobotInputs, stamp: int, *, scan: bool = True, odom: bool = True, tf: bool = True) -> None:
    """The data of one tick."""
    if scan:
        inputs.on_scan(LaserScan(Header(time_from_ns(stamp))))
    if odom:
        inputs.on_odom(Odometry(Header(time_from_ns(stamp))))
    if tf:
        inputs.transforms.on_bundle(TFMessage([stamped("robot_1/odom", "robot_1/base_footprint", stamp, 2.0)]))


@pytest.fixture
def inputs() -> RobotInputs:
    """Those of robot 1, which stands at x = 1 m on the map, without data; its base is known."""
    made = RobotInputs(1)
    made.on_base_info(1, BaseInfo())
    made.on_fixed(laser_on(1))
    made.transforms.on_static(TFMessage([stamped("map", "robot_1/odom", 0, 1.0)]))
    return made


@pytest.mark.parametrize("late", ["scan", "odom", "tf"])
def test_a_tick_needs_all_its_data(inputs: RobotInputs, late: str) -> None:
    """Data of the tick before does not count, of whichever kind it is."""
    give(inputs, S)
    assert not inputs.lacking(S)
    give(inputs, 2 * S, **{late: False})
    assert inputs.lacking(2 * S)
    give(inputs, 2 * S)
    assert not inputs.lacking(2 * S)


@pytest.mark.parametrize("late", ["scan", "odom", "tf"])
def test_without_data_no_tick_is_complete(inputs: RobotInputs, late: str) -> None:
    """Each kind has to come at least once, also for the first tick at time 0."""
    give(inputs, S, **{late: False})
    assert inputs.lacking(1)


@pytest.mark.parametrize("stamp", [S, 2 * S, 9 * S])
def test_a_frame_without_a_base_is_not_the_ticks_bundle(inputs: RobotInputs, stamp: int) -> None:
    """A process of the user's may put a frame onto `tf` itself, also one of the past or of the future."""
    give(inputs, S)
    give(inputs, 2 * S, tf=False)
    for _ in range(2):
        inputs.transforms.on_bundle(TFMessage([stamped("map", "carrot", stamp, 2.0)]))
    assert inputs.lacking(2 * S)
    give(inputs, 2 * S)
    inputs.transforms.on_bundle(TFMessage([stamped("map", "carrot", S, 2.0)]))
    assert not inputs.lacking(2 * S)


def test_newer_data_completes_a_tick(inputs: RobotInputs) -> None:
    """Data of a later time answers an earlier tick too."""
    give(inputs, 2 * S)
    assert not inputs.lacking(S)


def test_a_tick_may_do_without_transforms_but_not_without_odometry(inputs: RobotInputs) -> None:
    """Without an aggregator no transforms of the tick are promised; the safety layer needs the odometry always."""
    give(inputs, S, odom=False, tf=False)
    assert inputs.lacking(S, tf=False)
    give(inputs, S, tf=False)
    assert not inputs.lacking(S, tf=False)
    assert inputs.lacking(S)


def test_the_bases_of_a_tick_are_those_of_its_robots(inputs: RobotInputs) -> None:
    """In lock-step a tick waits for the bases of its robots, and no other base counts, whenever it came."""
    for robot_id in (5, 2):
        inputs.on_base_info(robot_id, BaseInfo(model=f"model {robot_id}"))
    robots = frozenset({2, 3})
    assert not inputs.has_bases(robots)
    inputs.on_base_info(3, BaseInfo(model="model 3"))
    assert inputs.has_bases(robots)
    assert {i: base.model for i, base in inputs.bases.items()} == {2: "model 2", 3: "model 3"}
    bases = inputs.bases
    assert inputs.has_bases(robots)
    assert inputs.bases is bases


def test_a_connected_tick_needs_the_fixed_transforms() -> None:
    """A bundle without a way from the map to the robot completes a tick only where that is not asked for."""
    inputs = RobotInputs(1)
    inputs.on_base_info(1, BaseInfo())
    inputs.on_fixed(laser_on(1))
    give(inputs, S)
    assert not inputs.lacking(S)
    assert inputs.lacking(S, connected=True)
    inputs.transforms.on_static(TFMessage([stamped("map", "robot_1/odom", 0, 1.0)]))
    assert not inputs.lacking(S, connected=True)


def test_no_tick_is_complete_without_the_base() -> None:
    """The first step of a run must not depend on whether `base_info`, the fixed frames or the scan are faster."""
    inputs = RobotInputs(1)
    give(inputs, S)
    inputs.on_base_info(1, BaseInfo())
    assert inputs.lacking(S)
    inputs.on_fixed(laser_on(1))
    assert not inputs.lacking(S)
    inputs = RobotInputs(1)
    give(inputs, S)
    inputs.on_fixed(laser_on(1))
    assert inputs.lacking(S)


def test_look_ups_give_the_newest_pose(inputs: RobotInputs) -> None:
    """The pose and its stamp, None for a frame that is unknown."""
    give(inputs, S)
    found = inputs.transforms.find_pose("map", "robot_1/base_footprint")
    assert found is not None
    pose, stamp = found
    assert (pose.x, stamp) == (3.0, S)
    assert inputs.transforms.find_pose("map", "robot_7/base_footprint") is None


def test_after_a_jump_only_what_is_fixed_stays(inputs: RobotInputs) -> None:
    """Scan, odometry and moving transforms are forgotten, also those that no look-up has read; the rest stays."""
    give(inputs, 9 * S)
    inputs.forget()
    assert (inputs.scan, inputs.odom, inputs.transforms.stamp, inputs.scan_stamp) == (None, None, 0, 0)
    assert inputs.transforms.find_pose("map", "robot_1/base_footprint") is None
    assert inputs.transforms.find_pose("map", "robot_1/odom") is not None
    give(inputs, S)
    assert not inputs.lacking(S, connected=True)


def test_robots_of_one_process_share_the_transforms() -> None:
    """What one has taken both look up; after a jump the next message is taken anew, whichever forgets last."""
    shared = TransformInputs()
    first, second = RobotInputs(1, transforms=shared), RobotInputs(2, transforms=shared)
    bundles = [TFMessage([stamped("map", "robot_1/base_footprint", at, float(at // S))]) for at in (9 * S, S)]
    first.transforms.on_bundle(bundles[0])
    assert second.transforms.find_pose("map", "robot_1/base_footprint") == (Pose2(9.0, 0.0, 0.0), 9 * S)
    first.forget()
    first.transforms.on_bundle(bundles[1])
    second.forget()
    assert first.transforms.find_pose("map", "robot_1/base_footprint") is None
    second.transforms.on_bundle(bundles[1])
    assert first.transforms.find_pose("map", "robot_1/base_footprint") == (Pose2(1.0, 0.0, 0.0), S)
