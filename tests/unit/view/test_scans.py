"""Each scan is drawn where its sensor was when it saw this."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from support.transforms import S, stamped
from zteam.messages import (
    Header,
    LaserScan,
    MapMetaData,
    OccupancyGrid,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    encode,
    time_from_ns,
)
from zteam.view import scene as scenes
from zteam.view.composing import Composer
from zteam.view.frames import _SCAN
from zteam.view.received import Received, Viewer
from zteam.view.requests import Look
from zteam.view.scene import Scene
from zteam.view.team_view import Places

BASE, LASER = "robot_0/base_footprint", "robot_0/base_laser_link"
TICK = S // 10
ODOMETER = TransformStamped(Header(time_from_ns(0), "map"), "robot_0/odom", Transform(Vector3(10.0)))


class Sent:
    """What robot 0 sends, and where the view shows its scan."""

    def __init__(self) -> None:
        self.received = Received(lambda: None)
        shapes = SimpleNamespace(robots={0: SimpleNamespace(lasers=[(0.1, 0.0, 0.0)])})
        self.state: Any = SimpleNamespace(
            received=self.received, places=Places(self.received), poses={}, queries=SimpleNamespace(shapes=shapes)
        )
        self.scene = Scene(self.state)

    def scan(self, tick: int) -> None:
        """A scan of a tick."""
        scan = LaserScan(Header(time_from_ns(tick * TICK), LASER), range_max=8.0, ranges=np.array([tick], np.float32))
        self.received.take("robot_0/base_scan", encode(scan))

    def bundle(self, tick: int) -> None:
        """The transforms of a tick: a metre a tick."""
        self.received.take("tf", encode(TFMessage([stamped("robot_0/odom", BASE, tick * TICK, float(tick))])))

    def static(self, parent: str = BASE) -> None:
        """Where odometry begins, and the laser on the robot."""
        self.received.take("tf_static", encode(TFMessage([ODOMETER, stamped(parent, LASER, 0, 0.1)])))

    def truth(self, tick: int, x: float) -> None:
        """The ground truth of a tick."""
        pose = PoseWithCovariance(Pose(Point(x)))
        truth = Odometry(Header(time_from_ns(tick * TICK), "map"), pose=pose)
        self.received.take("robot_0/base_pose_ground_truth", encode(truth))

    def drawn(self) -> tuple[int, float] | None:
        """Which scan is shown, and the x of its sensor (m)."""
        self.state.poses = self.state.places.look([0])
        if not list(self.scene.scans(0, 360)):
            return None
        _, scan, sensor = self.scene._placed["robot_0/base_scan"]
        return int(scan.ranges[0]), round(sensor.x, 6)


@pytest.fixture
def sent() -> Sent:
    """A robot with transforms."""
    found = Sent()
    found.static()
    return found


def test_a_scan_waits_for_the_transforms_of_its_tick(sent: Sent) -> None:
    """It comes before them; until then the scan before it stays."""
    sent.bundle(1)
    sent.scan(1)
    assert sent.drawn() == (1, 11.1)
    sent.scan(2)
    assert sent.drawn() == (1, 11.1)
    sent.bundle(2)
    assert sent.drawn() == (2, 12.1)


def test_a_scan_that_is_not_sent_any_more_leaves_the_map(sent: Sent) -> None:
    """A page whose view the robot has left gets one empty scan; when the robot is back in it, its scan comes again. A
    robot just beside the view is shown, as its beams reach into it."""
    sent.bundle(1)
    sent.scan(1)
    sent.drawn()
    composer, page = Composer(sent.state), Viewer(1, may_command=False)
    composer._scene = sent.scene

    def beams(x: float) -> list[int]:
        page.look = Look([x - 1.0, -1.0, x + 1.0, 1.0], ["scans"])
        return [_SCAN.unpack_from(block, 8)[1] for block in composer._scans(page)]

    assert [beams(x) for x in (11.0, 11.0, 90.0, 90.0, 11.0, 14.0)] == [[1], [], [0], [], [1], []]


def test_a_view_that_always_gets_the_next_scan_first_shows_each(sent: Sent) -> None:
    """A scan that waits is not replaced by the next one, or none would ever be shown."""
    sent.bundle(1)
    sent.scan(2)
    sent.drawn()
    seen = []
    for tick in range(2, 6):
        sent.bundle(tick)
        sent.scan(tick + 1)
        seen.append(sent.drawn())
    assert seen == [(tick, 10.1 + tick) for tick in range(2, 6)]


def test_a_seldom_localiser_holds_no_scan_up(sent: Sent) -> None:
    """Where odometry begins may be older than the scan; the robot's motion may not."""
    moving = TransformStamped(Header(time_from_ns(TICK), "map"), "robot_0/odom", Transform(Vector3(10.0)))
    sent.received.take("tf_static", encode(TFMessage([stamped(BASE, LASER, 0, 0.1)])))
    for tick in (1, 4):
        bases = stamped("robot_0/odom", BASE, tick * TICK, float(tick))
        sent.received.take("tf", encode(TFMessage([bases, moving] if tick == 1 else [bases])))
        sent.drawn()
    sent.scan(3)
    assert sent.drawn() == (3, 13.1)


def test_a_scan_without_transforms_of_its_time_is_shown_late(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot whose transforms have stopped is drawn with its newest pose, after a while."""
    sent.bundle(1)
    sent.scan(9)
    assert sent.drawn() is None
    now = scenes.monotonic()
    monkeypatch.setattr(scenes, "monotonic", lambda: now + 2 * scenes.PATIENCE)
    assert sent.drawn() == (9, 11.1)


def test_without_transforms_the_truth_of_that_time_counts() -> None:
    """The simulator sends it after the scan; a robot that is moved while the world stands has a new one."""
    sent = Sent()
    sent.truth(1, 1.0)
    sent.scan(1)
    assert sent.drawn() == (1, 1.1)
    sent.scan(2)
    assert sent.drawn() == (1, 1.1)
    sent.truth(2, 2.0)
    assert sent.drawn() == (2, 2.1)
    sent.truth(2, 7.0)
    sent.scan(2)
    assert sent.drawn() == (2, 7.1)


def test_a_scan_from_nowhere_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long it waits for its laser's frame; when that comes it is drawn."""
    sent = Sent()
    sent.static("robot_0/nowhere")
    sent.bundle(1)
    sent.scan(1)
    now = scenes.monotonic()
    monkeypatch.setattr(scenes, "monotonic", lambda: now + 2 * scenes.PATIENCE)
    assert sent.drawn() is None
    sent.static()
    assert sent.drawn() == (1, 11.1)


def test_a_scan_is_taken_off_the_page_when_its_frame_is_lost(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is sent no more, so pages get an empty one; the next one that has a place is drawn again."""
    sent.bundle(1)
    sent.scan(1)
    assert sent.drawn() == (1, 11.1)
    sent.static("robot_0/nowhere")
    sent.bundle(2)
    sent.scan(2)
    assert sent.drawn() == (1, 11.1)
    now = scenes.monotonic()
    monkeypatch.setattr(scenes, "monotonic", lambda: now + 2 * scenes.PATIENCE)
    assert sent.drawn() is None
    sent.static()
    assert sent.drawn() == (2, 12.1)


def test_a_grid_of_an_unknown_frame_is_not_drawn(sent: Sent) -> None:
    """It would lie at a place that nobody named."""
    sent.bundle(1)
    sent.drawn()
    one = MapMetaData(resolution=1.0, width=1, height=1)
    grid = OccupancyGrid(Header(frame_id="robot_7/odom"), one, np.zeros(1, np.int8))
    sent.received.take("robot_7/local_costmap/costmap", encode(grid))
    assert sent.scene.grid("robot_7/local_costmap/costmap") == []
    grid.header.frame_id = "robot_0/odom"
    sent.received.take("robot_0/local_costmap/costmap", encode(grid))
    assert len(sent.scene.grid("robot_0/local_costmap/costmap")) == 1
