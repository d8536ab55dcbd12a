"""follow: both laws in the line of four; the lectures' law (direct), and what it must never do."""

import math

import msgspec
import pytest

from support.flat_floor import TICK, make_scan, make_view
from support.team_floor import TeamFloor, line
from zteam import testing
from zteam.behaviors import Behavior, View, load_behavior
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import RobotStatus, Twist

NOW = 100 * TICK


def seeing(leader: Pose2 | None, age: float = 0.0, own_age: float = 0.0) -> View:
    """Robot 1's view with a free scan, its own pose, the origin, and robot 0 at `leader` unless that is None."""

    def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
        if (target, source) == ("map", "robot_1/base_footprint"):
            return Pose2(0.0, 0.0, 0.0), NOW - round(own_age * 1e9)
        if source == "robot_0/base_laser_link":
            return None
        assert source == "robot_0/base_footprint"
        return (leader, NOW - round(age * 1e9)) if leader else None

    return make_view(make_scan([30.0] * 271, NOW), now=NOW, robot_id=1, lookup=lookup)


def follower() -> Behavior:
    """Robot 1 following robot 0 straight."""
    return load_behavior("follow", {"leader": 0, "law": "direct"}, robot_id=1)


@pytest.mark.parametrize(
    ("leader", "speed", "turn"),
    [
        (Pose2(1.2, 0.0, 0.0), 0.6, 0.0),
        (Pose2(5.0, 0.0, 0.0), 0.7, 0.0),
        (Pose2(1.0, 0.1, 2.0), 0.5 * math.hypot(1.0, 0.1), 4.0 * math.atan2(0.1, 1.0)),
        (Pose2(0.1, 2.0, 0.0), 0.7, 3.14),
        (Pose2(0.1, -2.0, 0.0), 0.7, -3.14),
        (Pose2(0.8, 0.0, 0.0), 0.0, 0.0),
        (Pose2(-0.3, 0.2, 0.0), 0.0, 0.0),
    ],
)
def test_the_law(leader: Pose2, speed: float, turn: float) -> None:
    """v = 0.5 d up to 0.7, w = 4 atan2(y, x) within 3.14 both ways, zero at 0.8 m or nearer."""
    command = follower().step(seeing(leader))
    assert command.linear.x == pytest.approx(speed)
    assert command.angular.z == pytest.approx(turn)


@pytest.mark.parametrize(("age", "moves"), [(0.0, True), (0.5, True), (0.51, False), (-0.51, False)])
def test_a_stale_leader_is_not_followed(age: float, moves: bool) -> None:
    """A pose older than half a second, or from the future, does not move the robot; a fresh one does again."""
    behavior = follower()
    command = behavior.step(seeing(Pose2(2.0, 0.0, 0.0), age))
    assert (command.linear.x > 0.0) is moves
    assert behavior.reason == ("" if moves else "leader robot_0 not seen for 0.5 s")
    assert behavior.step(seeing(Pose2(2.0, 0.0, 0.0))).linear.x > 0.0
    assert behavior.reason == ""


def test_no_robot_follows_itself() -> None:
    """It is refused when it is made, or stands still where the robot's id was not known then."""
    with pytest.raises(UsageError, match="robot 1 cannot follow itself"):
        load_behavior("follow", {"leader": 1}, robot_id=1)
    behavior = load_behavior("follow", {"leader": 1, "law": "direct"})
    assert behavior.step(seeing(None)).linear.x == 0.0
    assert behavior.reason == "the robots follow each other in a circle"


def test_it_is_ready_with_its_leaders_pose() -> None:
    """The leader's pose is named as missing while it is not there or old."""
    behavior = follower()
    assert behavior.missing(seeing(None)) == ["the pose of its leader robot_0"]
    assert behavior.missing(seeing(Pose2(1.0, 0.0, 0.0), age=2.0)) == ["the pose of its leader robot_0"]
    assert behavior.missing(seeing(Pose2(1.0, 0.0, 0.0))) == []


def test_the_chain_is_the_newest_that_is_told() -> None:
    """Another leader in a status, a robot that is gone and a parameter that is set count in that very step."""
    behavior = load_behavior("follow", {"leader": 1}, robot_id=2)

    def reason(leader_of_1: int, team: tuple[int, ...] = (0, 1, 2)) -> str:
        told = {
            i: RobotStatus(robot_id=i, behavior="follow", leader=leader, gap=0.8)
            for i, leader in ((1, leader_of_1), (2, 1))
        }
        behavior.step(make_view(robot_id=2, team=team, inputs={"statuses": told}))
        return behavior.reason

    unknown, circle = "its own pose in map is not known", "the robots follow each other in a circle"
    assert [reason(0), reason(0), reason(2), reason(2), reason(0)] == [unknown, unknown, circle, circle, unknown]
    gone, alone = "leader robot_0 is gone", (1, 2)
    assert [reason(0, alone), reason(0, alone), reason(0)] == [gone, gone, unknown]
    team = (0, 2)
    assert reason(0, team) == unknown
    behavior.params = msgspec.structs.replace(behavior.params, on_leader_lost="stop")
    behavior.on_params()
    assert reason(0, team) == "leader robot_1 is gone"


def take_over(**params: float) -> Behavior:
    """Robot 1, which has followed robot 0 for a tick, and stands in its place when that is gone."""
    given = {"leader": 0, "on_leader_lost": "takeover", "takeover_behavior": "idle", **params}
    behavior = load_behavior("follow", given, robot_id=1)
    step_behind(behavior, 1.0)
    return behavior


def step_behind(
    behavior: Behavior, now: float, own: float = 0.0, head: float | None = 0.8, *, gone: bool = False, turns: int = 0
) -> Twist:
    """One step of robot 1 at x = `own` at time `now` (s). Robot 0 is at `head`, and says that its line has turned."""
    poses = {robot: (x, 0.0, 0.0) for robot, x in enumerate((head, own)) if x is not None}
    told = {0: RobotStatus(robot_id=0, behavior="wander", leader=-1, turns=turns, driver="behavior")}
    view = testing.make_view([9.0] * 91, fov=math.pi, robot_id=1, poses=poses, now=now, inputs={"statuses": told})
    return behavior.step(msgspec.structs.replace(view, team=(1,)) if gone else view)


@pytest.mark.parametrize(
    ("max_linear", "stands", "stop_at", "end"),
    [
        (0.7, range(0), 0, 2.6),
        (0.1, range(0), 0, 2.6),
        (0.7, range(20, 45), 0, 2.6),
        (0.7, range(20, 60), 100, 0.8),
        (0.7, range(20, 60), 40, 2.6),
    ],
    ids=["fast", "slow", "held for 2.5 s", "held for longer, and stopped later", "held, and stopped meanwhile"],
)
def test_a_lost_head_is_passed_by_a_robot_that_gets_on(
    max_linear: float, stands: range, stop_at: int, end: float
) -> None:
    """It gives that up after 3 s in which it has not moved; that it is slow or stopped is no reason."""
    behavior, now, own = take_over(max_linear=max_linear), 1.0, 0.0
    for tick in range(400):
        now += 30.0 if tick == stop_at else 0.1
        command = step_behind(behavior, now, own, gone=True)
        own += 0.1 * command.linear.x * (tick not in stands)
    assert command == Twist()
    assert own == pytest.approx(end, abs=0.1)


def test_a_robot_that_led_follows_a_head_that_is_back() -> None:
    """That it stood in the place of that head is not being stuck."""
    behavior = take_over()
    for tick in range(90):
        step_behind(behavior, 1.0 + 0.1 * tick, gone=True)
    assert step_behind(behavior, 10.0, head=1.8).linear.x > 0.0
    assert behavior.reason == ""


@pytest.mark.parametrize("lost", [-0.8, None])
def test_a_robot_that_leads_again_does_not_hand_over_at_once(lost: float | None) -> None:
    """The time in which it stood in the place of a head that was gone does not count."""
    behavior = take_over()
    for tick in range(120):
        gone = 20 <= tick < 110
        command = step_behind(behavior, 1.0 + 0.1 * tick, head=lost if gone else -0.8, gone=gone, turns=1)
    assert (command.linear.x, behavior.reason, behavior.turns) == (0.4, "", 1)


def test_a_line_that_was_stopped_for_long_drives_on_as_it_stood() -> None:
    """The time for which it was stopped makes no robot leave its way."""
    floor = TeamFloor(line(load_behavior("wander", {}, 0), 8), [])
    floor.tick()
    for _ in range(300):
        floor.step([load_behavior("idle", {})] * 8)
    for behavior in floor.team:
        behavior.on_release()
    for _ in range(30):
        floor.tick()
        # The head may turn, and those behind it after it.
        assert max(abs(command.angular.z) for command, _ in floor.commands[3:]) < 0.05


def test_a_line_behind_a_head_that_was_stopped_keeps_its_places() -> None:
    """The head alone stands for a minute (`zteam stop 0`), and then drives on: none of the others leaves its way."""
    floor = TeamFloor(line(load_behavior("wander", {}, 0), 8), [])
    floor.tick()
    for _ in range(600):
        floor.step([load_behavior("idle", {}), *floor.team[1:]])
        assert max(abs(command.angular.z) for command, _ in floor.commands) < 0.05
    floor.team[0].on_release()
    for _ in range(30):
        floor.tick()
        assert max(abs(command.angular.z) for command, _ in floor.commands[3:]) < 0.05
