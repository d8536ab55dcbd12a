"""Where robots and sensors are, from the newest messages."""

import pytest

from support.transforms import S, stamped
from zteam.messages import Header, Odometry, Point, Pose, PoseWithCovariance, TFMessage, encode, time_from_ns
from zteam.view.received import MAX_BUNDLES, Received
from zteam.view.team_view import Places

STATIC = TFMessage(
    [
        stamped("map", "robot_0/odom", 0, 10.0),
        stamped("robot_0/base_footprint", "robot_0/base_laser_link", 0, 0.1),
    ]
)


@pytest.fixture
def received() -> Received:
    """Messages as they come."""
    return Received(lambda: None)


@pytest.fixture
def places(received: Received) -> Places:
    """Reads them."""
    return Places(received)


def bundle(stamp: int, x: float) -> bytes:
    """The aggregator's bundle with robot 0 at x in its odometry."""
    return encode(TFMessage([stamped("robot_0/odom", "robot_0/base_footprint", stamp, x)]))


def test_poses_come_from_the_newest_bundle(received: Received, places: Places) -> None:
    """A robot without transforms has no pose; the stamp and the number tell which bundle it was."""
    received.take("tf_static", encode(STATIC))
    received.take("tf", bundle(1 * S, 1.0))
    received.take("tf", bundle(2 * S, 2.0))
    found = places.look([0, 1])
    assert {robot: pose[:2] for robot, pose in found.items()} == {0: (12.0, 0.0)}
    assert (places.stamp, places.from_truth) == (2 * S, False)
    arrival = received.get("tf")
    assert arrival is not None
    assert places.number == arrival.number


def test_messages_that_come_together_all_count(received: Received, places: Places) -> None:
    """A message of the bases and one of each localiser come between two looks: no robot is drawn at an older pose."""
    for tick in (1, 2):
        bases = [stamped(f"robot_{i}/odom", f"robot_{i}/base_footprint", tick * S, float(tick)) for i in range(3)]
        received.take("tf", encode(TFMessage(bases)))
        for i in range(3):
            origin = stamped("map", f"robot_{i}/odom", tick * S, 10.0 * tick)
            received.take("tf", encode(TFMessage([origin])))
        found = places.look(range(3))
        assert [pose.x for pose in found.values()] == [11.0 * tick] * 3


def test_transforms_are_not_kept_once_they_are_read(received: Received, places: Places) -> None:
    """Those of a hundred robots would fill the memory within minutes; nor are they kept while no page looks at them."""
    for tick in range(2 * MAX_BUNDLES):
        received.take("tf", bundle(tick + 1, 1.0))
    assert len(received.bundles) == MAX_BUNDLES
    places.look([0])
    assert not received.bundles


def test_a_sensor_is_where_it_was_when_it_saw_something(received: Received, places: Places) -> None:
    """Between two bundles its pose is interpolated; for a time that is not known it is the received."""
    received.take("tf_static", encode(STATIC))
    for second in (1, 2):
        received.take("tf", bundle(second * S, float(second)))
        places.look([0])
    laser = "robot_0/base_laser_link"
    poses = [places.pose_of(laser, stamp) for stamp in (S + S // 2, 9 * S, 2 * S)]
    assert [round(pose.x, 6) for pose in poses if pose] == [11.6, 12.1, 12.1]
    assert places.pose_of("robot_7/base_laser_link") is None


def test_a_moved_origin_of_odometry_is_news(received: Received, places: Places) -> None:
    """A robot that is dragged while the world stands is shown at its new place at once."""
    received.take("tf_static", encode(STATIC))
    received.take("tf", bundle(1 * S, 1.0))
    places.look([0])
    before = places.number
    received.take("tf_static", encode(TFMessage([stamped("map", "robot_0/odom", 0, 20.0)])))
    assert places.look([0])[0].x == 21.0
    assert places.number > before


def test_a_robot_that_is_new_in_a_world_that_stands_has_a_place(received: Received, places: Places) -> None:
    """Its odometry begins there, as before its first tick; in a world that runs its transforms come soon."""
    received.take("tf", bundle(1 * S, 1.0))
    places.look([0])
    received.take("tf_static", encode(TFMessage([stamped("map", "robot_5/odom", 0, 20.0)])))
    assert places.look([5]) == {}
    assert places.look([5], stands=True)[5].x == 20.0


def test_after_a_reset_the_earlier_time_counts(received: Received, places: Places) -> None:
    """Time that goes back makes the buffer forget."""
    received.take("tf_static", encode(STATIC))
    received.take("tf", bundle(50 * S, 5.0))
    places.look([0])
    received.take("tf", bundle(1 * S, 0.0))
    assert places.look([0])[0].x == 10.0
    assert places.stamp == 1 * S


def test_garbage_is_left_out(received: Received, places: Places) -> None:
    """A payload that does not decode changes nothing."""
    received.take("tf_static", encode(STATIC))
    received.take("tf", bundle(1 * S, 1.0))
    places.look([0])
    received.take("tf", b"\0\1\0\0garbage")
    received.take("tf_static", b"")
    assert places.look([0])[0].x == 11.0


def test_without_an_aggregator_the_ground_truth_counts(received: Received, places: Places) -> None:
    """The poses are marked as such."""
    truth = Odometry(Header(time_from_ns(3 * S), "map"), pose=PoseWithCovariance(Pose(Point(1.0, 2.0))))
    received.take("robot_4/base_pose_ground_truth", encode(truth))
    assert {robot: pose[:2] for robot, pose in places.look([4, 5]).items()} == {4: (1.0, 2.0)}
    assert (places.from_truth, places.stamp) == (True, 3 * S)


def test_a_robot_whose_truth_comes_no_more_is_compared_with_none(received: Received, places: Places) -> None:
    """What was found before would stay while the robot drives on; that of the others stays as it was."""
    places.compared = {0}
    received.take("tf_static", encode(STATIC))
    received.take("tf", bundle(1 * S, 1.0))
    truth = Odometry(Header(time_from_ns(1 * S), "map"), pose=PoseWithCovariance(Pose(Point(14.0))))
    received.take("robot_0/base_pose_ground_truth", encode(truth))
    places.look([0])
    found = places.truth_of(0)
    assert found is not None and [pose.x for pose in found] == [14.0, 11.0]
    places.compared = {1}
    assert places.truth_of(0) is None
