"""What an observer keeps of a team on a bus in memory, what it subscribes to, and how it follows a robot's motion."""

import math
from collections.abc import Callable

import pytest

from support.lockstep_doubles import ScriptedMonitor
from zteam import names
from zteam.bus.memory import MemoryHub
from zteam.geometry import Pose2
from zteam.messages import (
    Bool,
    Clock,
    Message,
    Odometry,
    Point,
    RobotStatus,
    TeamState,
    Twist,
    Vector3,
    time_from_ns,
)
from zteam.monitor.observer import LINK, PRESENCE, Motion, RobotView, TeamObserver

TICK = 100_000_000


def keys_of(hub: MemoryHub) -> list[str]:
    """The keys that the hub's sessions subscribe to."""
    return sorted(each.key_expr for each in hub.subscribers.values())


def put(hub: MemoryHub, key: str, message: Message) -> None:
    """Publish one message."""
    hub.bus().publisher(key, type(message)).put(message)


def truth(tick: int, x: float = 0.0, speed: float = 0.0) -> Odometry:
    """The ground truth of a tick."""
    message = Odometry()
    message.header.stamp, message.twist.twist = time_from_ns(tick * TICK), Twist(Vector3(speed))
    message.pose.pose.position = Point(x)
    return message


def test_nothing_is_observed_unasked(hub: MemoryHub) -> None:
    """An observer subscribes to no topic unasked, and once to a topic of all robots."""
    team = TeamObserver(hub.bus())
    assert keys_of(hub) == []
    team.observe(names.CLOCK, names.STATUS)
    team.observe(names.STATUS, names.CLOCK)
    team.observe(names.STATUS, robot_id=1)
    assert keys_of(hub) == [names.CLOCK, names.all_robots_key(names.STATUS)]


def test_what_is_ignored_is_forgotten(hub: MemoryHub) -> None:
    """Its subscription ends, and an old status is none of a later look; other topics stay."""
    team = TeamObserver(hub.bus(), names.STATUS, names.STALL)
    put(hub, names.robot_key(1, names.STATUS), RobotStatus(robot_id=1))
    assert team.robot(1).status is not None
    team.ignore(names.STATUS, names.CLOCK)
    assert keys_of(hub) == [names.all_robots_key(names.STALL)]
    assert names.STATUS not in team.robot(1).newest


def test_all_robots_take_the_place_of_one(hub: MemoryHub) -> None:
    """A message counts once, whatever was observed first; other topics stay."""
    team = TeamObserver(hub.bus())
    team.observe(names.CMD_VEL, names.NAVIGATION_STATUS, robot_id=1)
    put(hub, names.robot_key(1, names.CMD_VEL), Twist())
    team.observe(names.CMD_VEL, names.STATUS)
    put(hub, names.robot_key(1, names.CMD_VEL), Twist())
    assert team.robot(1).commands == 2
    all_robots = [names.all_robots_key(names.CMD_VEL), names.all_robots_key(names.STATUS)]
    assert keys_of(hub) == sorted([*all_robots, names.robot_key(1, names.NAVIGATION_STATUS)])


USES: dict[str, Callable[[RobotView], object]] = {
    names.GROUND_TRUTH: lambda robot: robot.pose,
    names.ODOM: lambda robot: robot.odom,
    names.BASE_SCAN: lambda robot: robot.scan,
    names.STALL: lambda robot: robot.stall,
    names.CMD_VEL: lambda robot: robot.commands,
    names.STATUS: lambda robot: robot.status,
}


@pytest.mark.parametrize("topic", USES)
def test_a_topic_of_a_robot_is_observed_from_its_first_use_on(hub: MemoryHub, topic: str) -> None:
    """A world that stands still is asked to repeat its last tick, but for commands."""
    repeated = list[bool]()
    robot = TeamObserver(hub.bus(), repeat=lambda arrived: repeated.append(arrived())).robot(3)
    for _ in range(2):
        USES[topic](robot)
    assert keys_of(hub) == [names.robot_key(3, topic)]
    assert repeated == ([] if topic == names.CMD_VEL else [False])


def test_the_newest_messages_of_a_robot(hub: MemoryHub) -> None:
    """NaN or None before the first."""
    team = TeamObserver(hub.bus(), names.GROUND_TRUTH, names.STATUS, names.STALL)
    robot = team.robot(1)
    assert math.isnan(robot.pose.x) and math.isnan(robot.speed) and robot.status is None and not robot.stall
    assert (team.describe(), team.reaches(0, [1])) == ("", False)
    put(hub, "robot_1/base_pose_ground_truth", truth(1, 2.0, 0.5))
    put(hub, "robot_0/base_pose_ground_truth", truth(1, 5.0))
    put(hub, "robot_1/stall", Bool(True))
    put(hub, "robot_1/status", RobotStatus(robot_id=1, reason="obstacle ahead"))
    assert (robot.pose, robot.speed, robot.stall) == (Pose2(2.0, 0.0, 0.0), 0.5, True)
    assert robot.distance_to(0) == 3.0
    assert team.describe() == "; robot_0 at x 5.00, y 0.00; robot_1 at x 2.00, y 0.00 (obstacle ahead)"
    assert [team.reaches(tick * TICK, [0, 1]) for tick in (0, 1, 2)] == [False, True, False]


def test_a_new_time_starts_at_zero(hub: MemoryHub) -> None:
    """The clock of a reset comes first: from then on no distance of before counts, and time since GO goes on."""
    team, gate = TeamObserver(hub.bus(), names.CLOCK, names.GROUND_TRUTH, names.TEAM_STATUS), ScriptedMonitor(hub)
    gate.say(TeamState.WAITING)
    assert team.go_at is None
    gate.give_go()
    for tick in (1, 2, 3):
        put(hub, names.CLOCK, Clock(time_from_ns(tick * TICK)))
        put(hub, "robot_1/base_pose_ground_truth", truth(tick, speed=1.0))
    assert (team.robot(1).distance_travelled, team.elapsed) == (pytest.approx(0.2), 2 * TICK)
    put(hub, names.CLOCK, Clock(time_from_ns(TICK)))
    assert (team.robot(1).distance_travelled, team.elapsed, team.now) == (0.0, 2 * TICK, TICK)
    assert team.go_at is not None


def test_processes_come_and_go(hub: MemoryHub) -> None:
    """By name and session; those that are gone were there."""
    team, bus = TeamObserver(hub.bus()), hub.bus()
    events = list[tuple[str, bool]]()
    team.on(PRESENCE, lambda name, alive: events.append((name, alive)))
    before = team.version
    token = bus.declare_token(names.token_key("robot_1", bus.instance))
    assert (team.alive("robot_1"), team.process_names(), team.instances("robot_1")) == (
        True,
        ["robot_1"],
        {bus.instance},
    )
    token.close()
    assert (team.alive("robot_1"), team.were_there) == (False, {"robot_1"})
    assert events == [("robot_1", True), ("robot_1", False)]
    assert team.version == before + 2
    team.wait_for_news(before, 10.0)


def test_handlers_get_what_they_ask_for(hub: MemoryHub) -> None:
    """With the robot, or with the key of the team's topic."""
    team, found = TeamObserver(hub.bus(), names.STATUS, names.CLOCK), list[object]()
    for event in (names.STATUS, names.CLOCK, LINK):
        team.on(event, lambda source, _news: found.append(source))
    put(hub, "robot_2/status", RobotStatus(robot_id=2))
    put(hub, names.CLOCK, Clock())
    assert found == [team.robot(2), names.CLOCK]


def drive(motion: Motion, first: int, *speeds: float) -> list[int]:
    """Truths of ticks from `first` on, without commands; how many ticks the robot was silent at each."""
    silent = []
    for k, speed in enumerate(speeds):
        motion.on_truth(truth(first + k, speed=speed))
        silent.append(motion.silent // TICK)
    return silent


def moving() -> Motion:
    """A robot that has driven for two ticks and had its last command in the second one."""
    motion = Motion()
    drive(motion, 1, 0.5, 0.5)
    motion.on_command(2 * TICK, 0.0)
    return motion


def test_the_times_of_a_drive() -> None:
    """Since when it moved, when it moved last, and since when it stands; a robot that stands is never silent."""
    motion = moving()
    assert drive(motion, 3, 0.5, 0.5, 0.5, 0.0, 0.0) == [1, 2, 3, 0, 0]
    assert (motion.started, motion.halted, motion.moved) == (TICK, 6 * TICK, 5 * TICK)


def test_a_robot_that_brakes_or_has_had_no_command_is_not_silent() -> None:
    """A base with a limited deceleration takes its time; before the first command nothing is known."""
    assert drive(moving(), 3, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0) == [1, 0, 0, 0, 0, 0]
    assert drive(Motion(), 1, *[0.5] * 9) == [0] * 9


def test_a_world_that_begins_anew_is_another_one() -> None:
    """After a reset old commands and motion do not count, and what moves there has moved since."""
    motion = moving()
    assert not motion.moved_since(0, 2 * TICK)
    assert drive(motion, 1, *[0.5] * 9) == [0] * 9
    assert motion.moved_since(0, 2 * TICK) and motion.moved_since(1, 8 * TICK) and not motion.moved_since(1, 9 * TICK)


def test_the_distance_counts_from_the_first_truth_of_a_world() -> None:
    """A robot that was away drove nothing meanwhile: its first velocity after that holds for one tick."""
    motion = Motion()
    for first, speeds in ((1, (1.0, 1.0)), (50, (1.0, 1.0))):
        drive(motion, first, *speeds)
    assert motion.distance == pytest.approx(0.3)
    drive(motion, 1, 1.0)
    assert motion.distance == 0.0
