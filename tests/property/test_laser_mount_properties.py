"""Every reader of a scan finds its hits where plain geometry in space puts them, however the laser is mounted."""

import math
import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from studies.view.frames import decode_frame
from support.examples import examples
from support.flat_floor import make_odometry, make_view
from support.transforms import S, stamped
from zteam.behaviors import SafetyLayer, read_beams
from zteam.geometry import Pose2, quaternion_from_rpy
from zteam.messages import (
    Header,
    LaserScan,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    encode,
    time_from_ns,
)
from zteam.messages.base import DEFAULT_BASE
from zteam.navigation.planning.amcl import AmclOptions, choose_beams
from zteam.navigation.planning.costmap import LETHAL_OBSTACLE, Costmap, make_circle
from zteam.navigation.planning.grid import GridGeometry
from zteam.navigation.process.inputs import Inputs
from zteam.robot.process.inputs import RobotInputs
from zteam.transforms.lasers import MAX_TILT
from zteam.view import frames
from zteam.view.received import Received
from zteam.view.scene import Scene
from zteam.view.team_view import Places

Floats = NDArray[np.float64]
FRAME, BASE = "robot_0/base_laser_link", "robot_0/base_footprint"
FAR = 2.4
"""Metres: nearer hits are marked in costmaps and remembered by the safety layer."""
ALONG, ACROSS = 0.2, -0.1
"""Metres in `map`: where the base stands."""


def turned(roll: float, pitch: float, yaw: float) -> Floats:
    """The rotation matrix of fixed-axis roll, pitch and yaw, factor by factor."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


turns = st.floats(-math.pi, math.pi)
tilts = st.sampled_from([0.0, 1.0]).flatmap(lambda share: st.floats(0.0, share * 0.69 * MAX_TILT))
"""Of roll and of pitch: together at most MAX_TILT."""
mounts = st.tuples(st.sampled_from([0.0, math.pi]), tilts, tilts, turns, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
"""Upright or upside down; roll and pitch, yaw (rad); x and y (m)."""
lasers = st.tuples(st.integers(2, 60), st.floats(-3.2, 3.2), st.floats(0.02, 0.1), st.sampled_from([-1.0, 1.0]))
"""Beams, first angle, increment (rad), and which way round they run."""


@st.composite
def scans(draw: st.DrawFn) -> LaserScan:
    """Hits between 0.5 m and FAR, and beams that met nothing, or say nothing."""
    count, first, step, way = draw(lasers)
    ranges = draw(
        st.lists(st.floats(0.5, FAR - 0.35) | st.sampled_from([30.0, math.nan]), min_size=count, max_size=count)
    )
    header = Header(time_from_ns(S), FRAME)
    last = first + way * step * (count - 1)
    found = np.array(ranges, np.float32)
    found.flags.writeable = False
    return LaserScan(header, first, last, way * step, 0.0, 0.0, 0.1, 30.0, found)


def hits_in_space(scan: LaserScan, rotation: Floats, x: float, y: float) -> Floats:
    """(n, 2): where the beams that met something ended, seen from above, in the base."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    ends = scan.ranges * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles))
    points = (rotation @ ends)[:2].T + np.array((x, y))
    return points[scan.ranges < FAR]


def published(mount: tuple[float, ...]) -> TransformStamped:
    """What the base publishes of its laser."""
    over, roll, pitch, yaw, x, y = mount
    rotation = Quaternion(*quaternion_from_rpy(over + roll, pitch, yaw))
    return TransformStamped(Header(frame_id=BASE), FRAME, Transform(Vector3(x, y, 0.3), rotation))


def seen_by_robot(scan: LaserScan, fixed: TransformStamped) -> tuple[Floats, Floats]:
    """(n, 2) each, in the base: hits as a behaviour reads them, and as the safety layer remembers them."""
    inputs = RobotInputs(0)
    inputs.on_fixed(TFMessage([fixed]))
    inputs.on_scan(scan)
    view = inputs.view(S, 0.1, (0,))
    assert view.scan is not None
    assert view.scan.angle_increment > 0.0
    bearings, distances = read_beams(view.scan)
    hit = distances < FAR
    ends = distances[hit] * np.stack((np.cos(bearings[hit]), np.sin(bearings[hit])))
    layer = SafetyLayer()
    odom = make_odometry(Pose2(0.0, 0.0, 0.0))
    layer.limit(Twist(), make_view(view.scan, now=S, laser=view.laser, odom=odom))
    return ends.T + view.laser, layer.points.T


def seen_by_navigation(scan: LaserScan, fixed: TransformStamped) -> tuple[Floats, Costmap]:
    """(n, 2): ends of amcl's beams in the base, and a costmap about the base."""
    transforms = Places(Received(lambda: None)).buffer
    transforms.set_transform_static(fixed, "test")
    inputs = Inputs(0, transforms, {0: DEFAULT_BASE})  # type: ignore[arg-type]
    inputs.newest["base_scan"] = scan
    planned = inputs.planning_scan()
    assert planned is not None
    costmap = Costmap(GridGeometry(120, 120, 0.05, Pose2(-3.0, -3.0, 0.0)), make_circle(0.2))
    costmap.observe(planned, Pose2(0.0, 0.0, 0.0))
    costmap.update()
    return choose_beams(planned, (), AmclOptions(max_beams=len(scan.ranges), laser_max_range=FAR), None), costmap


def drawn_by_view(scan: LaserScan, fixed: TransformStamped) -> Floats:
    """(n, 2): the points that a page draws, in the base."""
    received = Received(lambda: None)
    state: Any = SimpleNamespace(received=received, places=Places(received), poses={})
    received.take("tf_static", encode(TFMessage([fixed, stamped("map", "robot_0/odom", 0, ALONG)])))
    received.take("tf", encode(TFMessage([stamped("robot_0/odom", BASE, S, 0.0, ACROSS)])))
    received.take("robot_0/base_scan", encode(scan))
    state.places.look([0])
    ((_, _, block),) = Scene(state).scans(0, 1000)
    _, ((_, _, _, body),) = decode_frame(frames.encode_frame(1, 0, 0.0, 0.0, [block]))
    _, count, x, y, yaw, first, step, _, unit = struct.unpack_from("<HH7f", body)
    steps = np.frombuffer(body, "<u2", count, 32)
    angles = yaw + first + step * np.arange(count)
    points = np.stack((x + unit * steps * np.cos(angles), y + unit * steps * np.sin(angles)), axis=1)
    return points[steps < frames.INVALID] - (ALONG, ACROSS)


def farthest(points: Floats, others: Floats) -> float:
    """Metres from the point that is farthest from all others to the nearest of these, both ways."""
    if not len(points) and not len(others):
        return 0.0
    assert len(points)
    assert len(others)
    apart = np.hypot(*(points[:, None] - others).transpose(2, 0, 1))
    return float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))


@examples(300)
@given(scans(), mounts)
def test_all_readers_agree_with_the_geometry_in_space(scan: LaserScan, mount: tuple[float, ...]) -> None:
    """Behaviours, the safety layer, amcl, the costmap and the page have each hit where the rotated beam ends, within
    the error of bearing that a tilt of this size may cause; the costmap within a cell."""
    over, roll, pitch, yaw, x, y = mount
    fixed, tilt = published(mount), math.acos(math.cos(roll) * math.cos(pitch))
    expected = hits_in_space(scan, turned(over + roll, pitch, yaw), x, y)
    within = FAR * 0.2501 * tilt**2 + 1e-5
    behavior, remembered = seen_by_robot(scan, fixed)
    amcl, costmap = seen_by_navigation(scan, fixed)
    assert len(behavior) == len(amcl) == len(expected)
    assert farthest(behavior, expected) <= within
    assert farthest(amcl, expected) <= within
    assert farthest(remembered, expected) <= within
    assert farthest(drawn_by_view(scan, fixed), expected) <= within + 0.0011
    marked = np.argwhere(costmap.costs == LETHAL_OBSTACLE)[:, ::-1] * 0.05 + 0.025 - 3.0
    assert farthest(marked, expected) <= within + 0.05
