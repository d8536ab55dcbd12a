"""A user's own node and behaviour, tested without processes."""

import math
from typing import Any

import pytest

import zteam
from zteam import testing
from zteam.behaviors import load_behavior
from zteam.errors import BusError, ZteamError
from zteam.messages import Bool, Odometry, Point, Twist, Vector3
from zteam.testing import MemoryHub, make_view, run_node


def crowd(node: zteam.Node) -> None:
    """The crowd alarm of docs/time.md."""
    truths: dict[str, Odometry] = {}
    node.subscribe("robot_$*/base_pose_ground_truth", Odometry, truths.__setitem__, every_tick=True)
    alarm = node.publisher("crowd/alarm", Bool)

    def step(_now: int) -> None:
        places = [t.pose.pose.position.x for t in truths.values()]
        alarm.put(Bool(max(places) - min(places) < 0.7))

    node.run(step)


def at(x: float) -> Odometry:
    """A true pose at `x` metres."""
    odom = Odometry()
    odom.pose.pose.position = Point(x)
    return odom


def test_a_node_steps_once_a_tick_on_its_inputs() -> None:
    """What the step publishes is there when `tick` returns, from the inputs that were published before; a key has one
    publisher."""
    hub, heard = MemoryHub(), []
    hub.bus().subscribe("crowd/alarm", Bool, lambda _, message: heard.append(message.data))
    with run_node(crowd, hub, name="crowd", robots=[0, 1]) as running:
        for distance in (2.0, 0.5, 2.0):
            running.publish("robot_0/base_pose_ground_truth", at(0.0))
            running.publish("robot_1/base_pose_ground_truth", at(distance))
            assert running.tick() is None
        assert [d.key for d in hub.bus().declarations() if d.publishes].count("robot_0/base_pose_ground_truth") == 1
    assert heard == [False, True, False]


def test_a_missing_input_is_told() -> None:
    """Nothing is waited for: an input that was not published fails the test at once."""
    with run_node(crowd, MemoryHub(), name="crowd", robots=[0, 1]) as running:
        running.publish("robot_0/base_pose_ground_truth", at(0.0))
        with pytest.raises(BusError, match=r"^crowd waits for inputs of 0\.1 s: publish all"):
            running.tick()


def test_a_robots_own_process_answers_with_its_command() -> None:
    """`tick` returns what the step of a robot's process returned."""

    def main(node: zteam.Node) -> None:
        node.run(lambda now: Twist(Vector3(now / 1e9)))

    with run_node(main, MemoryHub(), name="robot_3", robots=[3]) as running:
        assert [running.tick(), running.tick()] == [Twist(Vector3(0.1)), Twist(Vector3(0.2))]


def test_time_begins_again_with_a_reset() -> None:
    """The node hears of the reset, and its first step has the first tick's time once more."""
    seen: list[Any] = []

    def main(node: zteam.Node) -> None:
        node.on_time_reset(lambda: seen.append("reset"))
        node.run(seen.append)

    with run_node(main, MemoryHub()) as running:
        running.tick()
        running.tick()
        running.reset()
        running.tick()
    assert seen == [100_000_000, 200_000_000, "reset", 100_000_000]


def test_inputs_of_the_new_time_count_after_a_reset() -> None:
    """An input that is published between the reset and the first tick belongs to that tick."""
    hub, heard = MemoryHub(), []
    hub.bus().subscribe("crowd/alarm", Bool, lambda _, message: heard.append(message.data))
    with run_node(crowd, hub, name="crowd", robots=[0, 1]) as running:
        for distance in (2.0, 0.5):
            running.publish("robot_0/base_pose_ground_truth", at(0.0))
            running.publish("robot_1/base_pose_ground_truth", at(distance))
            running.tick()
            running.reset()
    assert heard == [False, True]


@pytest.mark.parametrize("where", ["body", "step", "callback"])
def test_an_error_of_the_node_is_the_tests(where: str) -> None:
    """What the user's code raises comes out of `tick`, or of the end of the `with`."""

    def fail(*_: Any) -> None:
        raise ValueError("out of plans")

    def main(node: zteam.Node) -> None:
        if where == "body":
            fail()
        node.subscribe("plan", Bool, fail)
        node.run(fail if where == "step" else lambda now: None)

    hub = MemoryHub()
    with pytest.raises(ValueError, match="out of plans"), run_node(main, hub) as running:
        if where == "callback":
            running.publish("plan", Bool())
        running.tick()


def test_a_body_without_run_is_told() -> None:
    """A body that returns at once never becomes a process of the team."""
    with pytest.raises(ZteamError, match=r"node: the body returned without node\.run\(step\)"):
        run_node(lambda node: None, MemoryHub()).__enter__()


def test_a_view_by_hand_shows_scan_and_poses() -> None:
    """A shipped behaviour drives up to its leader by it, and stops where the scan shows an obstacle. The first beam
    looks to the right by half of `fov`; a view without ranges has no scan and no pose."""
    view = make_view([30.0] * 181, robot_id=1, poses={0: (3.0, 1.0, 0.0), 1: (1.0, 1.0, 0.0)})
    leader = view.base_from_robot(0)
    assert leader is not None
    assert leader[0] == pytest.approx((2.0, 0.0, 0.0))
    assert view.map_from_base() == ((1.0, 1.0, 0.0), 1_000_000_000)
    assert view.base_from_robot(2) is None
    assert load_behavior("follow", {"leader": 0}).step(view).linear.x > 0.0
    avoid = load_behavior("avoid", {})
    assert avoid.step(view).linear.x > 0.0
    assert avoid.step(make_view([0.3] * 181)).linear.x == 0.0
    scan = make_view([1.0, 2.0, 3.0], fov=math.pi).scan
    assert scan is not None
    assert (scan.angle_min, scan.angle_increment, list(scan.ranges)) == (-math.pi / 2, math.pi / 2, [1.0, 2.0, 3.0])
    bare = make_view()
    assert (bare.scan, bare.map_from_base(), bare.team) == (None, None, ())


def test_team_is_the_fixtures_class() -> None:
    """`def test_x(team: Team)` is annotated with what the fixture gives."""
    from zteam.team.testing.team import TeamFixture

    assert testing.Team is TeamFixture
