"""What has come for one robot, what of it counts, and when a tick is complete."""

import logging

import pytest

from support.real_time_robot import TICK
from support.transforms import S, laser_on, stamped
from support.world_texts import box_points
from zteam import names
from zteam.clock import monotonic
from zteam.geometry import Pose2
from zteam.messages import (
    BaseInfo,
    Header,
    LaserScan,
    Odometry,
    Point32,
    Polygon,
    PoseStamped,
    RobotDriver,
    RobotStatus,
    TFMessage,
    Twist,
    TwistStamped,
    Vector3,
    time_from_ns,
)
from zteam.messages.base import DEFAULT_BASE, BaseOverride
from zteam.messages.topics import type_of_key
from zteam.robot.behaviors.behavior import DeclaredInput
from zteam.robot.process import inputs as module
from zteam.robot.process.inputs import SOURCES, RobotInputs, TransformInputs
from zteam.robot.view import SILENT_AFTER


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
    """Neither none nor that of the tick before will do, of whichever kind; that of a later one will."""
    give(inputs, S, **{late: False})
    assert inputs.lacking(1)
    assert bool(inputs.lacking(1, tf=False)) is (late != "tf")
    give(inputs, S)
    assert not inputs.lacking(S)
    give(inputs, 2 * S, **{late: False})
    assert inputs.lacking(2 * S)
    give(inputs, 3 * S)
    assert not inputs.lacking(2 * S)


@pytest.mark.parametrize("stamp", [S, 9 * S])
def test_a_frame_without_a_base_is_not_the_ticks_bundle(inputs: RobotInputs, stamp: int) -> None:
    """A process of the user's may put a frame onto `tf` itself, also one of the past or of the future."""
    give(inputs, S)
    give(inputs, 2 * S, tf=False)
    inputs.transforms.on_bundle(TFMessage([stamped("map", "carrot", stamp, 2.0)]))
    assert inputs.lacking(2 * S)
    give(inputs, 2 * S)
    inputs.transforms.on_bundle(TFMessage([stamped("map", "carrot", S, 2.0)]))
    assert not inputs.lacking(2 * S)


def test_the_bases_of_a_tick_are_those_of_its_robots(inputs: RobotInputs) -> None:
    """In lock-step a tick waits for the bases of its robots, and no other base counts, whenever it came."""
    for robot_id in (5, 2):
        inputs.on_base_info(robot_id, BaseInfo(model=f"model {robot_id}"))
    robots = frozenset({2, 3})
    assert not inputs.has_bases(robots)
    inputs.on_base_info(3, BaseInfo(model="model 3"))
    assert inputs.has_bases(robots)
    bases = inputs.view(S, 0.1, (), robots=robots).bases
    assert {i: base.model for i, base in bases.items()} == {2: "model 2", 3: "model 3"}
    assert [*inputs.view(S, 0.1, ()).bases] == [1, 2, 3, 5]


def test_the_first_tick_needs_the_base_and_the_fixed_frames() -> None:
    """It must not depend on whether these or the scan are faster; nor, if asked for, on the way from the map."""
    inputs = RobotInputs(1)
    give(inputs, S)
    inputs.on_base_info(1, BaseInfo())
    assert inputs.lacking(S) == ["robot_1/tf_static"]
    inputs.on_fixed(laser_on(1))
    assert not inputs.lacking(S)
    assert inputs.lacking(S, connected=True) == ["tf"]
    inputs.transforms.on_static(TFMessage([stamped("map", "robot_1/odom", 0, 1.0)]))
    assert not inputs.lacking(S, connected=True)
    other = RobotInputs(1)
    give(other, S)
    other.on_fixed(laser_on(1))
    assert other.lacking(S) == ["robot_1/base_info"]


def test_after_a_jump_only_what_is_fixed_stays(inputs: RobotInputs) -> None:
    """Scan, odometry and moving transforms are forgotten, also those that no look-up has read; the rest stays."""
    give(inputs, 9 * S)
    assert inputs.transforms.find_pose("map", "robot_1/base_footprint") == (Pose2(3.0, 0.0, 0.0), 9 * S)
    assert inputs.transforms.find_pose("map", "robot_7/base_footprint") is None
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


def test_the_interval_of_scans_is_the_shorter_one_of_the_newest_two(inputs: RobotInputs) -> None:
    """A single long one is an outage."""
    intervals = []
    for stamp in (1.0, 1.25, 1.5, 9.0, 9.5, 10.0):
        give(inputs, round(stamp * 1e9))
        intervals.append(inputs.scan_interval)
    assert intervals == [0.1, 0.25, 0.25, 0.25, 0.5, 0.5]


def test_scans_without_a_time_stamp_are_told() -> None:
    """A driver that leaves the stamp at 0 is what the robot waits for, until a scan has one."""
    inputs = RobotInputs(3)
    inputs.on_base_info(3, BaseInfo(model="cart"))
    give(inputs, 0)
    assert inputs.missing() == ["a time stamp in its scans (robot_3/base_scan), which have 0"]
    give(inputs, 1)
    assert inputs.missing() == []


WIDE = BaseInfo(model="wide", footprint=Polygon([Point32(x, y) for x, y in box_points(0.6)]), max_vel_x=0.5)


def test_the_default_holds_until_the_base_tells() -> None:
    """The newest message counts below what the team file sets. A robot is not ready without it."""
    known = RobotInputs(3, BaseOverride(max_vel_x=0.3))
    assert (known.base.footprint, known.base.max_vel_x) == (DEFAULT_BASE.footprint, 0.3)
    assert known.missing() == ["its footprint (robot_3/base_info)"]
    known.on_base_info(3, BaseInfo(model="narrow"))
    known.on_base_info(3, WIDE)
    assert known.missing() == []
    assert (known.base.model, known.base.half_width, known.base.max_vel_x) == ("wide", 0.6, 0.3)


def test_a_base_that_tells_nothing_is_waited_for_two_seconds(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """From the first scan on, not from the start; then the default holds, which is said once."""
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[-1])
    known, told = RobotInputs(0), RobotInputs(0)
    told.on_base_info(0, WIDE)
    with caplog.at_level(logging.WARNING, "zteam"):
        for seconds in (100.0, 102.0, 102.1, 103.0):
            now.append(seconds)
            known.wait_no_longer()
            told.wait_no_longer()
            assert bool(known.missing()) is (seconds <= 102.0)
    (record,) = caplog.records
    assert record.getMessage().startswith("no robot_0/base_info: ")
    # It may come later all the same.
    known.on_base_info(0, WIDE)
    assert known.base.half_width == 0.6


GOAL = DeclaredInput("goal", "robot_1/goal_pose", PoseStamped)
OTHERS = DeclaredInput("others", "robot_$*/status", RobotStatus)


def test_what_a_step_sees_of_declared_inputs_does_not_change_afterwards() -> None:
    """Each name is there before anything comes. A view stays as it was; the next one has the message, by robot."""
    inputs = RobotInputs(1, declared=[GOAL, OTHERS])
    before = inputs.view(0, 0.0, ()).inputs
    inputs.on_declared(GOAL, GOAL.key, PoseStamped(), TICK)
    for robot_id in (2, 0):
        inputs.on_declared(OTHERS, names.robot_key(robot_id, names.STATUS), RobotStatus(robot_id=robot_id), TICK)
    assert dict(before) == {"goal": None, "others": {}}
    after = inputs.view(0, 0.0, ()).inputs
    assert (after["goal"], [*after["others"]]) == (PoseStamped(), [0, 2])
    assert inputs.view(0, 0.0, (), is_first=True).inputs == before
    inputs.forget()
    assert inputs.view(0, 0.0, ()).inputs == before


def test_a_silent_teammate_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """By simulated time in lock-step, else by the host's, from when it could be heard on; not after a jump."""
    inputs, key, now = RobotInputs(1, declared=[OTHERS]), names.robot_key(2, names.STATUS), monotonic()
    inputs.on_declared(OTHERS, key, RobotStatus(robot_id=2), TICK)
    late = TICK + round(SILENT_AFTER * 1e9)
    assert [inputs.silent(stamp) for stamp in (late, late + 1)] == [frozenset(), {2}]
    assert inputs.silent(None) == frozenset()
    monkeypatch.setattr(module, "monotonic", lambda: now + 1.0 + SILENT_AFTER)
    assert [inputs.silent(None, heard_from) for heard_from in (now, now + 2.0)] == [{2}, frozenset()]
    inputs.forget()
    assert inputs.silent(late + 1) == frozenset()


def test_the_source_of_highest_priority_drives_until_its_time_out() -> None:
    """Teleop drives over navigation for 0.5 s after its last velocity, then navigation does, then the behaviour.

    Neither a jump back nor a velocity of an hour ahead, as after the host's clock was set, drives. What the mux listens
    to is what tools know of these keys.
    """
    mux, nav = RobotInputs(1), TwistStamped(Header(), Twist(Vector3(0.2)))
    mux.on_velocity(RobotDriver.TELEOP, "", Twist(Vector3(0.3)), TICK)
    mux.on_velocity(RobotDriver.NAVIGATION, "", nav, 4 * TICK)
    choices = [mux.choose(tick * TICK) for tick in range(4, 11)]
    teleop = RobotDriver.TELEOP, Twist(Vector3(0.3))
    assert choices == [teleop] * 3 + [(RobotDriver.NAVIGATION, nav.twist)] * 3 + [None]
    mux.forget()
    assert mux.choose(TICK) is None
    mux.on_velocity(RobotDriver.TELEOP, "", Twist(Vector3(0.3)), 36_000 * TICK)
    assert mux.choose(TICK) is None
    assert all(type_of_key(names.robot_key(0, topic)) is kind for topic, kind in SOURCES.values())
