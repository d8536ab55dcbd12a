"""One robot's navigation without a bus: what it says and does when something that it needs is missing or wrong."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from support.goals import make_goal
from support.installed_packages import install
from zteam import messages, names
from zteam.config.localisation import LOST_DEVIATION
from zteam.geometry import Pose2, Velocity
from zteam.messages import Header, LaserScan, NavigationState, RobotDriver, RobotState, RobotStatus, time_from_ns
from zteam.messages.base import DEFAULT_BASE
from zteam.navigation.planning.amcl import Amcl
from zteam.navigation.planning.costmap import LETHAL_OBSTACLE, CostmapOptions
from zteam.navigation.planning.grid import GridMap, make_map
from zteam.navigation.planning.parameters import Localizer, Parameters, Plugin, SmootherOptions
from zteam.navigation.process.inputs import Inputs
from zteam.navigation.process.navigator import STOP
from zteam.navigation.process.robot import NO_MAP, RobotNavigation
from zteam.tf import Buffer

TICK = 100_000_000


class Transforms(Buffer):
    """The team's transforms, as the test says."""

    def __init__(self) -> None:
        super().__init__()
        self.left: dict[int, Pose2] = {}


class Outputs:
    """Keeps what would be published."""

    def __init__(self) -> None:
        self.velocity = STOP
        self.frames: list[Pose2] = []
        self.covariance = np.zeros((3, 3))

    def drive(self, _now: int, velocity: Velocity, *, active: bool) -> None:
        self.velocity = velocity

    def localise(self, _now: int, _ahead: int, localiser: Any) -> None:
        if localiser.map_from_odom is not None:
            self.frames.append(localiser.map_from_odom)
        self.covariance = localiser.covariance

    def show(self, *_: object) -> None:
        """Nothing to look at."""

    def tell(self, *_: object) -> None:
        """The navigator tells the test itself."""

    def log(self, *_: object) -> None:
        """So it does here."""

    def forget(self) -> None:
        """Nothing is remembered."""


def box(size: float = 6.0) -> GridMap:
    """A square room of this size around the origin, cells of 0.1 m."""
    count = round(size / 0.1)
    cells = np.zeros((count, count), np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    return make_map(cells, 0.1, Pose2(-size / 2, -size / 2, 0.0))


class Robot:
    """Robot 0 in the middle of a room, whose transforms, scan and ground truth come in each tick."""

    def __init__(self, localizer: Localizer = "none", **options: Any) -> None:
        self.transforms, self.outputs = Transforms(), Outputs()
        self.inputs = Inputs(0, self.transforms, {0: DEFAULT_BASE})  # type: ignore[arg-type]
        parameters = Parameters(localizer=localizer, **options)
        planner = parameters.make_planner()
        self.robot = RobotNavigation(self.inputs, parameters, self.outputs, planner, 1)  # type: ignore[arg-type]
        self.now, self.sees, self.is_placed, self.moves = 0, True, True, True
        self._put("base_footprint", "base_laser_link", static=True)

    @property
    def state(self) -> NavigationState:
        return self.robot.navigator.state

    @property
    def text(self) -> str:
        return self.robot.navigator.text

    def _put(self, parent: str, child: str, *, static: bool = False) -> None:
        frame = parent if parent == "map" else f"robot_0/{parent}"
        header = Header(time_from_ns(self.now), frame)
        transform = messages.TransformStamped(header, f"robot_0/{child}", messages.Transform(messages.Vector3(0.0)))
        put = self.transforms.set_transform_static if static else self.transforms.set_transform
        assert put(transform, "test") is None

    def step(self, count: int = 1) -> Velocity:
        """Ticks of 0.1 s."""
        for _ in range(count):
            self.now += TICK
            if self.moves:
                self._put("odom", "base_footprint")
            if self.is_placed and self.moves:
                self._put("map", "odom")
            if self.sees:
                # The walls of the room of 6 m.
                angles = np.linspace(-1.0, 1.0, 11)
                ranges = (2.95 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))).astype(np.float32)
                self.inputs.newest[names.BASE_SCAN] = LaserScan(
                    Header(time_from_ns(self.now), "base_laser_link"), -1.0, 1.0, 0.2, 0.0, 0.1, 0.0, 30.0, ranges
                )
            self.robot.step(self.now, 0.1, {})
        return self.outputs.velocity

    def go(self, x: float, y: float = 0.0) -> None:
        """Send a goal."""
        self.inputs.newest[names.GOAL_POSE] = make_goal(x, y)


def driving(localizer: Localizer = "none") -> Robot:
    """A robot on its way to a goal two metres ahead."""
    robot = Robot(localizer)
    robot.robot.set_map(box())
    robot.go(2.0)
    assert robot.step() != STOP
    assert robot.state is NavigationState.DRIVING
    return robot


def test_without_a_map_it_says_so_and_goes_on_when_one_comes() -> None:
    """The goal is kept meanwhile."""
    robot = Robot()
    robot.go(2.0)
    assert robot.step() == STOP
    assert robot.text == NO_MAP
    robot.robot.set_map(box())
    assert robot.step().x > 0.0
    assert (robot.state, robot.text) == (NavigationState.DRIVING, "")


def test_a_scan_that_stays_away_stops_it() -> None:
    """A second after the last one, however long that takes: with the scans back it goes on to the same goal."""
    robot = driving()
    robot.sees = False
    assert robot.step(9).x > 0.0
    assert robot.step(3) == STOP
    assert robot.text == "no scan on robot_0/base_scan for 1 s"
    robot.step(155)
    assert robot.state is NavigationState.DRIVING
    robot.sees = True
    assert robot.step().x > 0.0
    assert (robot.state, robot.robot.navigator.recoveries) == (NavigationState.DRIVING, 0)


@pytest.mark.parametrize("localizer", ["none", "amcl"])
def test_poses_that_stay_away_stop_it(localizer: Localizer) -> None:
    """It does not drive by old ones, keeps its goal however long that takes, and begins no recovery."""
    robot = driving(localizer)
    robot.moves = False
    robot.step(12)
    assert robot.step(150) == STOP
    told = "pose of robot_0/base_footprint in map" if localizer == "none" else "no transforms from robot_0/odom"
    assert told in robot.text
    robot.moves = True
    assert robot.step(2).x > 0.0
    assert (robot.state, robot.robot.navigator.recoveries) == (NavigationState.DRIVING, 0)


def test_it_waits_for_a_robot_that_is_silent() -> None:
    """The robot's process may be frozen: no recovery begins, and with a status it goes on."""
    robot = driving()
    status = RobotStatus(Header(time_from_ns(robot.now)), state=RobotState.RUNNING, driver=RobotDriver.NAVIGATION)
    robot.inputs.newest[names.STATUS] = status
    assert robot.step(150) == STOP
    assert (robot.text, robot.robot.navigator.recoveries) == ("robot_0 is silent", 0)
    status.header.stamp = time_from_ns(robot.now)
    assert robot.step().x > 0.0


@pytest.mark.parametrize("localizer", ["none", "amcl"])
def test_a_scan_from_nowhere_is_not_used(localizer: Localizer) -> None:
    """Neither a costmap nor amcl takes it, and the robot says what lacks; with the laser's frame back it drives on."""
    robot = driving(localizer)
    seen = robot.robot._costmaps.local.layers.seen.copy()  # type: ignore[union-attr]
    robot._put("elsewhere", "base_laser_link", static=True)
    assert robot.step(2) == STOP
    assert robot.text == "it needs its laser's frame robot_0/base_laser_link (robot_0/tf_static, from its base)"
    robot._put("base_footprint", "base_laser_link", static=True)
    assert robot.step(2).x > 0.0
    assert robot.text == ""
    assert seen.any()


def test_what_was_seen_stays_where_it_was_without_odometry_in_the_transforms() -> None:
    """Another process places the base itself in `map`: the local costmap takes no walls along with the robot."""
    robot = Robot()
    robot.robot.set_map(make_map(np.zeros((60, 60), np.int8), 0.1, Pose2(-3.0, -3.0, 0.0)))
    for tick in range(1, 7):
        stamp = time_from_ns(tick * TICK)
        placed = messages.TransformStamped(
            Header(stamp, "map"), "robot_0/base_footprint", messages.Transform(messages.Vector3(0.1 * tick))
        )
        assert robot.transforms.set_transform(placed, "test") is None
        if tick == 1:
            ranges = np.full(1, 1.4, np.float32)
            header = Header(stamp, "base_laser_link")
            robot.inputs.newest[names.BASE_SCAN] = LaserScan(header, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 30.0, ranges)
        robot.robot.step(tick * TICK, 0.1, {})
        robot.inputs.newest.clear()
    assert robot.robot._costmaps is not None
    local = robot.robot._costmaps.local
    assert local.cost_at(1.52, 0.02) == LETHAL_OBSTACLE
    assert local.cost_at(1.92, 0.02) < LETHAL_OBSTACLE


def test_fake_makes_the_transform_of_the_truth() -> None:
    """What it publishes puts the robot where it is. There is no ground truth on a real robot."""
    robot = Robot("fake")
    robot.robot.set_map(box())
    robot.go(1.0)
    assert robot.step() == STOP
    assert robot.text == "no ground truth: 'fake' needs a simulator; use amcl"
    truth = messages.Odometry(Header(time_from_ns(2 * TICK)))
    truth.pose.pose.position.x, truth.pose.pose.position.y = 1.0, -0.5
    robot.inputs.newest[names.GROUND_TRUTH] = truth
    robot.step()
    assert robot.outputs.frames == [Pose2(1.0, -0.5, 0.0)]


def test_a_map_of_another_size_is_planned_on_anew() -> None:
    """The goal holds; one that the new map does not have is given up with the reason."""
    robot = driving()
    robot.robot.set_map(box(8.0))
    assert robot.step().x > 0.0
    assert robot.state is NavigationState.DRIVING
    robot.robot.set_map(box(2.0))
    assert robot.step() == STOP
    assert robot.state is NavigationState.ABORTED
    assert robot.text == "the goal (2.00, 0.00) is outside of the map"
    robot.go(0.5)
    robot.step()
    assert robot.state is not NavigationState.ABORTED


def test_parameters_that_do_not_fit_the_map_are_told() -> None:
    """An inflation of more cells than there may be stops the robot, and not the process."""
    robot = Robot(global_layers=CostmapOptions(inflation_radius=50.0))
    robot.robot.set_map(box())
    robot.go(2.0)
    assert robot.step() == STOP
    assert robot.text == "inflation_radius 50 is 500 cells of 0.1 m: at most 180"


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ({"x": 40.0}, "outside of the map"),
        ({"x": 1.0, "frame": "odoom"}, "'odoom', from which no transform leads to"),
        ({"x": math.nan}, "the goal is not finite, too far away, or its orientation is no rotation"),
        ({"x": 1.0, "w": 0.0}, "the goal is not finite, too far away, or its orientation is no rotation"),
    ],
)
def test_a_goal_that_cannot_be_is_refused_with_a_reason(place: dict[str, Any], text: str) -> None:
    """The robot, on its way to another goal, stops, and takes the next one; what is sent of it can be read."""
    robot = driving()
    robot.inputs.newest[names.GOAL_POSE] = goal = make_goal(place["x"], 0.0, 0.0, place.get("frame", "map"))
    goal.pose.orientation.w = place.get("w", 1.0)
    assert robot.step() == STOP
    assert robot.state is NavigationState.ABORTED
    assert text in robot.text
    messages.encode(robot.robot.navigator.message)
    robot.go(1.0)
    assert robot.step().x > 0.0


def test_a_goal_that_cannot_be_read_stops_it() -> None:
    """The bus has dropped it; the goal before does not count any more."""
    robot = driving()
    robot.inputs.newest[names.GOAL_POSE] = "a number is not finite"
    assert robot.step() == STOP
    assert (robot.state, robot.text) == (NavigationState.ABORTED, "the goal cannot be read: a number is not finite")
    assert robot.step() == STOP
    robot.go(1.0)
    assert robot.step().x > 0.0


@pytest.mark.parametrize("frame", ["/robot_0/base_footprint", "base_footprint", "odom", "/odom", "robot_0/odom", ""])
def test_a_goal_may_be_in_a_frame_of_the_robot(frame: str) -> None:
    """It is taken to the map where the robot is now, with the frame's full name or the robot's own one."""
    robot = driving()
    robot.inputs.newest[names.GOAL_POSE] = make_goal(1.5, 0.0, 0.5, frame)
    robot.step()
    assert robot.robot.navigator.goal == pytest.approx((1.5, 0.0, 0.5))


@pytest.mark.parametrize(
    ("status", "text"),
    [
        (RobotStatus(state=RobotState.READY), "waits for GO"),
        (RobotStatus(state=RobotState.RUNNING, driver=RobotDriver.TELEOP), "teleop drives"),
        (RobotStatus(state=RobotState.RUNNING, is_stopped=True), "stopped (zteam stop --release)"),
    ],
)
def test_it_waits_without_an_end_for_a_robot_that_does_not_obey_yet(status: RobotStatus, text: str) -> None:
    """Before GO, while a person drives, and while it is stopped; no recovery begins."""
    robot = driving()
    status.header.stamp = time_from_ns(robot.now + 150 * TICK)
    robot.inputs.newest[names.STATUS] = status
    assert robot.step(150) == STOP
    assert (robot.state, robot.text) == (NavigationState.DRIVING, text)
    assert robot.robot.navigator.recoveries == 0
    status.state, status.driver, status.is_stopped = RobotState.RUNNING, RobotDriver.NAVIGATION, False
    assert robot.step().x > 0.0
    assert robot.text == ""


def test_a_goal_that_has_just_come_is_canceled_too() -> None:
    """The robot has not stepped since: it drives to neither goal."""
    robot = driving()
    robot.go(-2.0)
    assert robot.robot.cancel()
    assert robot.step() == STOP
    assert robot.state is NavigationState.CANCELED
    assert not robot.robot.cancel()


def test_amcl_begins_where_the_transforms_say_and_takes_an_initial_pose(caplog: pytest.LogCaptureFixture) -> None:
    """One in another frame does not count, and the log says why."""
    robot = driving("amcl")
    assert robot.outputs.frames[-1][:2] == pytest.approx((0.0, 0.0), abs=0.5)
    message = messages.PoseWithCovarianceStamped(Header(frame_id="map"))
    message.pose.pose.position.x = 1.0
    message.pose.covariance = np.diag([1e-4] * 6).ravel()
    robot.inputs.newest[names.INITIAL_POSE] = message
    robot.step()
    assert robot.outputs.frames[-1][:2] == pytest.approx((1.0, 0.0), abs=0.2)
    robot.inputs.newest[names.INITIAL_POSE] = messages.PoseWithCovarianceStamped(Header(frame_id="odom"))
    robot.step()
    assert "the initial pose does not count: its frame is 'odom', not 'map'" in caplog.text


def test_a_robot_that_may_be_anywhere_does_not_drive() -> None:
    """Particles all over the map: it says how far its place is known."""
    robot = driving("amcl")
    assert robot.robot.why_not_localized_globally() == ""
    robot.robot.localize_globally()
    assert robot.step() == STOP
    assert robot.text.startswith("it is lost: its place is known to ±")
    assert "no particles" in driving().robot.why_not_localized_globally()


def test_navigation_drives_no_car() -> None:
    """It turns on the spot: the goal waits for another base, and the text says why."""
    robot = driving()
    robot.inputs._bases[0] = replace(DEFAULT_BASE, drive="car")  # type: ignore[index]
    robot.robot.set_base()
    assert robot.step() == STOP
    assert "car" in robot.text


def test_a_robot_that_was_carried_away_says_that_it_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands, names the key that takes its pose, and its estimate is as wide as that of a lost robot."""
    robot = driving("amcl")
    assert robot.step() != STOP
    monkeypatch.setattr(Amcl, "is_elsewhere", True)
    assert robot.step() == STOP
    assert "it is lost" in robot.text
    assert names.robot_key(robot.inputs.robot_id, names.INITIAL_POSE) in robot.text
    assert robot.outputs.covariance[0, 0] > LOST_DEVIATION**2


CREEP = """
from zteam.planning import Velocity


class Creep:
    set_path = remaining = lambda *_: 1.0

    def __init__(self, parameters):
        self.speed = parameters["speed"]

    def command(self, costmap, pose, velocity, seconds):
        return Velocity(self.speed)
"""


def test_no_controller_is_faster_than_the_limits_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the velocity smoother hold for a package's controller too: in speed, and in speeding up."""
    install(tmp_path, "acme", "[zteam.controllers]\ncreep = acme_creep:Creep\n", {"acme_creep": CREEP})
    monkeypatch.syspath_prepend(tmp_path)
    limits = {"max_velocity": (0.25, 0.0, 1.0), "min_velocity": (-0.15, 0.0, -1.0), "max_accel": (1.0, 0.0, 1.0)}
    for speed, driven in ((0.9, [0.1, 0.2, 0.25, 0.25]), (-0.9, [-0.1, -0.15, -0.15, -0.15])):
        robot = Robot(controller_plugin=Plugin("creep", {"speed": speed}), smoother=SmootherOptions(**limits))
        robot.robot.set_map(box())
        robot.go(2.0)
        assert [robot.step().x for _ in range(4)] == pytest.approx(driven)


def test_the_controller_of_a_package_drives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An entry point of the documented group, with the parameters that it is given."""
    install(tmp_path, "acme", "[zteam.controllers]\ncreep = acme_creep:Creep\n", {"acme_creep": CREEP})
    monkeypatch.syspath_prepend(tmp_path)
    robot = Robot(controller_plugin=Plugin("creep", {"speed": 0.123}))
    robot.robot.set_map(box())
    robot.go(2.0)
    assert robot.step(3).x == 0.123
