"""What other processes want to be drawn, and what robots sense, in the frame of the map."""

import json
import math

import numpy as np

from zteam.bus.graph import KeyRow
from zteam.geometry import Pose2
from zteam.messages import (
    Duration,
    Fiducial,
    Fiducials,
    Header,
    Marker,
    MarkerAction,
    MarkerArray,
    OccupancyGrid,
    Path,
    Point,
    Point32,
    Polygon,
    PolygonStamped,
    Pose,
    Range,
    Twist,
    encoding_of,
)
from zteam.messages.nav_msgs import MapMetaData
from zteam.view.commands import make_tiles, room_in
from zteam.view.documents import MarkerBoard, as_document, drawn_polygon, fiducials_of, sonar_of
from zteam.view.queries import topic_row
from zteam.view.received import Drawables, Received, Topic

ONE_LEFT = Pose2(0.0, 1.0, math.pi / 2)


def pose_of(frame: str) -> Pose2 | None:
    """The frame `robot` is one metre to the left and looks there; no other frame is known."""
    return ONE_LEFT if frame == "robot" else None


def marker(number: int, action: int = MarkerAction.ADD, frame: str = "robot", seconds: int = 0) -> Marker:
    """A marker two metres ahead of the robot."""
    return Marker(
        Header(frame_id=frame), "n", number, action=action, pose=Pose(Point(2.0)), lifetime=Duration(seconds),
        points=[Point(1.0, math.nan)],
    )  # fmt: skip


def test_markers_are_added_changed_and_deleted() -> None:
    """Each by its key, namespace and id, at its place in the map."""
    board = MarkerBoard()
    board.take("k", [marker(1), marker(2), marker(2)], now=0.0)
    (first, second) = board.drawn(pose_of, now=1.0)
    assert (first["ns"], first["id"], second["id"]) == ("k/n", 1, 2)
    assert (round(first["x"], 6), round(first["y"], 6)) == (0.0, 3.0)
    board.take("k", [marker(1, MarkerAction.DELETE)], now=0.0)
    assert [drawn["id"] for drawn in board.drawn(pose_of, now=1.0)] == [2]
    board.take("other", [marker(5)], now=0.0)
    board.take("k", [marker(0, MarkerAction.DELETEALL)], now=0.0)
    assert [drawn["id"] for drawn in board.drawn(pose_of, now=1.0)] == [5]
    board.keep([])
    assert board.drawn(pose_of, now=1.0) == []


def test_a_marker_ends_with_its_lifetime() -> None:
    """Zero means that it stays."""
    board = MarkerBoard()
    board.take("k", [marker(1, seconds=2), marker(2)], now=10.0)
    assert len(board.drawn(pose_of, now=11.9)) == 2
    assert [drawn["id"] for drawn in board.drawn(pose_of, now=12.0)] == [2]


def test_a_marker_of_an_unknown_frame_waits() -> None:
    """It is drawn when its frame is known."""
    board = MarkerBoard()
    board.take("k", [marker(1, frame="later")], now=0.0)
    assert board.drawn(pose_of, now=0.0) == []
    assert len(board.drawn(lambda _: ONE_LEFT, now=0.0)) == 1


def test_a_document_has_only_numbers_that_json_has() -> None:
    """NaN and infinities become 0, which a page can draw."""
    board = MarkerBoard()
    board.take("k", [marker(1)], now=0.0)
    assert json.loads(as_document(board.drawn(pose_of, now=0.0)))[0]["points"] == [[1.0, 0.0]]


def test_a_polygon_is_a_closed_line() -> None:
    """Its first point comes again at the end."""
    polygon = PolygonStamped(
        Header(frame_id="robot"), Polygon([Point32(0.0, 0.0), Point32(1.0, 0.0), Point32(1.0, 1.0)])
    )
    drawn = drawn_polygon("k", polygon, ONE_LEFT)
    assert (drawn["type"], len(drawn["points"]), drawn["points"][0]) == (4, 4, drawn["points"][-1])


def test_a_sonar_tells_whether_it_has_a_return() -> None:
    """Its pose is in the map; at its maximum range, and below its minimum, there is none."""

    def reading(distance: float) -> Range:
        return Range(Header(frame_id="robot"), 0, 0.5, 0.1, 4.0, distance)

    found = [sonar_of(3, reading(distance), ONE_LEFT) for distance in (2.5, 4.0, math.inf, 0.0)]
    assert [sonar["range"] for sonar in found] == [2.5, None, None, None]
    assert [found[0][name] for name in ("robot", "x", "y", "max_range")] == [3, 0.0, 1.0, 4.0]


def test_a_fiducial_is_where_it_is_seen() -> None:
    """Range and bearing are taken from the finder's pose."""
    seen = Fiducials(Header(frame_id="robot"), [Fiducial(7, 2.0, math.pi / 2, 0.0)])
    (found,) = fiducials_of(1, seen, ONE_LEFT)
    assert (found["robot"], found["id"], round(found["x"], 3), round(found["y"], 3)) == (1, 7, -2.0, 1.0)


def grid(cells: np.ndarray, resolution: float = 0.1) -> OccupancyGrid:
    """A map that begins at x 1, y 2."""
    rows, columns = cells.shape
    info = MapMetaData(resolution=resolution, width=columns, height=rows, origin=Pose(Point(1.0, 2.0)))
    return OccupancyGrid(Header(frame_id="map"), info, cells.astype(np.int8).ravel())


def test_only_tiles_that_changed_are_made_again() -> None:
    """The others keep their version, so a page is not sent them."""
    cells = np.zeros((300, 300))
    before = make_tiles("c", grid(cells), 1, Pose2(0.0, 0.0, 0.0), [])
    cells[299, 299] = 100
    after = make_tiles("c", grid(cells), 2, Pose2(0.0, 0.0, 0.0), before)
    assert len(after) == 4
    assert [old is new for old, new in zip(before, after, strict=True)] == [True, True, True, False]


def test_a_grid_that_lies_about_its_size_has_no_tiles() -> None:
    """Nothing is drawn of it."""
    wrong = grid(np.zeros((3, 3)))
    wrong.info.width = 70_000
    assert make_tiles("c", wrong, 1, Pose2(0.0, 0.0, 0.0), []) == []


def test_a_place_is_free_if_all_around_it_is() -> None:
    """Unknown cells and those outside of the map are not free."""
    cells = np.zeros((40, 40))
    cells[20, 20], cells[0, 0] = 100, -1
    is_free = room_in(grid(cells), 0.3)
    assert [is_free(x, y) for x, y in ((4.0, 5.0), (3.05, 4.05), (3.3, 4.0), (1.2, 2.2), (0.0, 0.0))] == [
        True, False, False, False, False,
    ]  # fmt: skip


def test_types_are_learnt_from_the_first_message() -> None:
    """A key that carries nothing to draw is left alone from then on; a key of zteam's own is never tried."""
    received = Received(lambda: None)
    keys = ["my/path", "my/twist", "my/marks", "robot_0/odom", "map", "a/*", "@session/1/x"]
    drawables = Drawables(keys, received)
    assert {topic.key for topic in drawables.topics(["plans"])} == {"my/marks", "my/path", "my/twist"}
    for key, kind in (("my/path", Path), ("my/twist", Twist), ("my/marks", MarkerArray)):
        received.take(key, b"", encoding_of(kind))
    drawables = Drawables(keys, received)
    assert drawables.topics(["plans"]) == {Topic("my/path", latched=True)}
    assert drawables.topics(["markers"]) == {Topic("my/marks", latched=True, every=True)}
    assert drawables.topics(["scans"]) == set()
    assert (drawables.of("plans"), drawables.of("markers")) == (["my/path"], ["my/marks"])


def test_a_topic_has_the_type_and_rate_of_what_came() -> None:
    """One of which nothing came in the survey has no rate; a single message says little about one."""
    rows = [
        KeyRow("crowd/alarm", "std_msgs/msg/Bool", count, rate=rate) for count, rate in ((9, 7.31), (1, 0.83), (0, 0.0))
    ]
    assert [topic_row(row)["hz"] for row in rows] == [7.3, 1.0, None]
    row = topic_row(KeyRow("mine", publishers=["a"], subscribers=["b", "c"], type=""))
    assert [*row.values()] == ["mine", "", None, 1, 2]
