"""Any scan whatever gives a finite command within the limits; any team file whatever is a team or a ConfigError."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, reject
from hypothesis import strategies as st

from support.flat_floor import TICK, make_view
from zteam.behaviors import decide, load_behavior, missing
from zteam.config.resources import teams_folder
from zteam.errors import ConfigError, DecodeError
from zteam.geometry import Pose2
from zteam.messages import Header, LaserScan, Odometry, decode, encode, time_from_ns
from zteam.node.process_options import RobotOptions, from_line, to_line
from zteam.robot.scans import first_clear, look_ahead, look_along
from zteam.team.file.entries import Team, behavior_of, static_transform
from zteam.team.file.reading import load_team, read_team_file, team_world

NOW = 100 * TICK
any_float32 = st.floats(width=32)
"""NaN and infinities included."""


@st.composite
def scans(draw: st.DrawFn) -> LaserScan:
    """Any scan that can come over the wire, most of them fresh."""
    plausible = st.sampled_from([2.0**-8, -(2.0**-8), 0.0, 0.125])  # exact in float32
    ranges = draw(st.lists(any_float32 | st.floats(0.0, 5.0, width=32), max_size=40))
    repeated = np.array(ranges * draw(st.sampled_from([1, 1, 30])), np.float32)
    return LaserScan(
        header=Header(time_from_ns(draw(st.just(NOW) | st.integers(0, 2 * NOW)))),
        angle_min=draw(st.floats(-4.0, 4.0, width=32) | any_float32),
        angle_increment=draw(plausible | any_float32),
        range_min=draw(st.sampled_from([0.0, 0.125]) | any_float32),
        range_max=draw(st.just(30.0) | any_float32),
        ranges=repeated,
    )


any_pose = st.builds(Pose2, st.floats(), st.floats(), st.floats())
lookups = st.none() | st.tuples(any_pose | st.builds(Pose2, *[st.floats(-9.0, 9.0)] * 3), st.integers(0, 2 * NOW))
BEHAVIORS: list[tuple[str, dict[str, Any]]] = [
    ("forward", {"speed": 1.0}),
    ("forward", {"speed": -1.0}),
    ("avoid", {}),
    ("wander", {}),
    ("follow", {"leader": 1, "max_linear": 1.0}),
]


@pytest.mark.parametrize(("name", "params"), BEHAVIORS)
@given(st.lists(st.tuples(st.none() | scans(), lookups, st.floats(0.0, 10.0)), max_size=4))
def test_commands_are_finite_and_within_limits(
    name: str, params: dict[str, Any], steps: list[tuple[LaserScan | None, tuple[Pose2, int] | None, float]]
) -> None:
    """Whatever is sensed, in whatever order, the wheels get numbers they can follow, and x and yaw alone."""
    behavior = load_behavior(name, params, robot_id=0)
    for scan, found, dt in steps:
        view = make_view(scan, now=NOW, dt=dt, lookup=lambda target, source, found=found: found, odom=Odometry())
        command, reason = decide(behavior, view)
        assert abs(command.linear.x) <= 1.0
        assert abs(command.angular.z) <= math.pi
        assert not any((command.linear.y, command.linear.z, command.angular.x, command.angular.y))
        assert "\n" not in reason
        assert all(isinstance(text, str) for text in missing(view, behavior))


@given(scans(), st.floats(0.0, math.pi))
def test_what_a_scan_says_survives_the_wire(scan: LaserScan, half_angle: float) -> None:
    """A decoded scan, whose array is read-only, says the same as the one that was sent."""
    try:
        received = decode(LaserScan, encode(scan))
    except DecodeError:
        # The codec lets no scan through whose geometry is no number.
        reject()
    assert look_ahead(received, half_angle) == look_ahead(scan, half_angle)
    cone = look_ahead(received, half_angle)
    assert cone is None or (cone.nearest >= 0.0 and 0.0 <= cone.invalid <= 1.0 and abs(cone.bearing) <= math.pi)
    assert look_along(received, 0.2, half_angle) >= 0.0
    headings = [half_angle * share for share in (0.0, 0.5, -0.5, 1.0, -1.0)]
    for reach in (-1.0, 0.1, 0.6, 5.0):
        clear = [heading for heading in headings if look_along(received, 0.2, heading) >= reach]
        assert first_clear(received, 0.2, reach, 0.0, tuple(headings[1:])) == (clear[0] if clear else None)


@given(st.integers(1, 300), st.floats(-math.pi, math.pi), st.floats(0.1, 9.0), st.floats(0.05, 1.5))
def test_turning_a_scan_round_changes_nothing(count: int, bearing: float, reach: float, half_angle: float) -> None:
    """The same beams listed clockwise show the same cone."""
    angles = np.linspace(-2.0, 2.0, count)
    ranges = np.where(np.abs(angles - bearing) < 0.3, reach, 10.0)
    step = float(angles[1] - angles[0]) if count > 1 else 0.0
    left = LaserScan(angle_min=-2.0, angle_increment=step, range_max=30.0, ranges=ranges.astype(np.float32))
    right = LaserScan(
        angle_min=float(angles[-1]), angle_increment=-step, range_max=30.0, ranges=ranges[::-1].astype(np.float32)
    )
    a, b = look_ahead(left, half_angle), look_ahead(right, half_angle)
    assert (a is None) == (b is None)
    if a and b:
        assert a.nearest == b.nearest


plain = st.recursive(
    st.integers() | st.floats() | st.booleans() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=4,
)


def texts_of(value: Any) -> str:
    """A value as TOML, written without the code under test."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(c):08x}" for c in value) + '"'
    if isinstance(value, list):
        return "[" + ",".join(map(texts_of, value)) + "]"
    if isinstance(value, dict):
        return "{" + ",".join(f"{texts_of(k)}={texts_of(v)}" for k, v in value.items()) + "}"
    return repr(value)


def tables(*keys: str) -> st.SearchStrategy[dict[str, Any]]:
    """A table that has some of these keys, and perhaps others, with likely and unlikely values."""
    likely = st.integers(-1, 3) | st.sampled_from(
        ["follow", "avoid", "map", "office.world", "none", "previous", "1-3", "${x:-2}", "${y}"]
    )
    pose = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3)
    return st.dictionaries(st.sampled_from(keys) | st.text(max_size=2), likely | pose | plain, max_size=5)


team_files = st.fixed_dictionaries(
    {},
    optional={
        "team": tables("world", "seed", "restart") | plain,
        "robots": st.lists(tables("id", "ids", "follow", "behavior", "pose", "pose_step", "model"), max_size=3) | plain,
        "defaults": tables("id", "follow", "behavior", "model", "speed", "base", "restart") | plain,
        "nodes": st.lists(tables("name", "command", "folder", "expect"), max_size=2) | plain,
        "include": st.lists(st.sampled_from(["line", "any.toml", "."]), max_size=2) | plain,
        "static_transforms": st.lists(tables("parent", "child", "x", "qw", "yaw"), max_size=2) | plain,
        "x": plain,
    },
)


def use(path: Path) -> Team:
    """Load a team file and do everything that can be done with it."""
    team = load_team(path)
    for robot in team.robots:
        told = RobotOptions(robot.id, *behavior_of(robot), base=robot.base)
        assert to_line("robot", from_line(to_line("robot", told))[1]) == to_line("robot", told)
    for entry in team.static_transforms:
        turn = static_transform(entry).transform.rotation
        assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.0)
    team_world(read_team_file(path))
    return team


@given(team_files)
@example({"include": ["line", "line"]})
def test_any_tables_are_a_team_or_a_config_error(
    tmp_path_factory: pytest.TempPathFactory, file: dict[str, Any]
) -> None:
    """Nothing but ConfigError, whose lines all begin with the file or one that it includes, comes out."""
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_text("\n".join(f"{key} = {texts_of(value)}" for key, value in file.items()), encoding="utf-8")
    try:
        use(path)
    except ConfigError as error:
        files = f"{path}:", f"{teams_folder()}/"
        assert all(line.startswith(files) for line in str(error).splitlines())


@given(st.binary(max_size=60) | st.text("[]{}\"'=.#\n\\,0aé-: ", max_size=60).map(lambda s: s.encode()))
def test_any_bytes_are_a_team_or_a_config_error(tmp_path_factory: pytest.TempPathFactory, raw: bytes) -> None:
    """A file of rubbish is told as such."""
    path = tmp_path_factory.getbasetemp() / "rubbish.toml"
    path.write_bytes(raw)
    with pytest.raises(ConfigError, match=r"rubbish\.toml:"):
        load_team(path)
