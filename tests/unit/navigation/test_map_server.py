"""The map server on a bus in memory, and maps as messages."""

import math
import threading
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from support.limits import LIMIT
from support.transports import wait_until_true
from zteam.bus import MemoryHub
from zteam.cli import listening
from zteam.cli import main as zteam
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import Header, OccupancyGrid, Point, Pose, decode, encode
from zteam.navigation.map_server import run_map_server
from zteam.navigation.planning.grid import GridMap, make_map
from zteam.navigation.planning.maps import map_grid, map_message, read_map
from zteam.node.node import Node
from zteam.node.shutdown import Stop

VALUES = np.array([[0, 100, -1, 30], [65, 25, 26, 64]], np.int8)


@pytest.fixture
def grid() -> GridMap:
    """A map that is turned and lies in the grid of a country (UTM with its zone), with values of all kinds."""
    return make_map(VALUES, 0.05, Pose2(32_455_123.5, 5_411_932.25, 0.25))


@pytest.fixture
def served(hub: MemoryHub, grid: GridMap) -> None:
    """A map server has been running for a while."""
    hub.bus().publisher("map", OccupancyGrid, latched=True).put(map_message(grid))


Save = Callable[..., int]


@pytest.fixture
def save(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Save:
    """Runs `zteam map save WORDS` on the bus of the test."""
    monkeypatch.setattr(listening, "connect", lambda *_, **__: hub.bus())
    return lambda *words: zteam.main(["map", "save", *map(str, words)])


def assert_same(one: GridMap, other: GridMap) -> None:
    """Both lie at the same place and have the same cells."""
    assert one.frame.resolution == other.frame.resolution
    assert one.frame.origin == pytest.approx(other.frame.origin, abs=1e-9)
    np.testing.assert_array_equal(one.cells, other.cells)


def test_a_map_survives_the_bus(grid: GridMap) -> None:
    """Cells, place, turn and resolution come back, although the resolution travels with 32 bits."""
    message = decode(OccupancyGrid, encode(map_message(grid)))
    assert (message.header.frame_id, message.info.width, message.info.height) == ("map", 4, 2)
    assert_same(map_grid(message), grid)


def test_a_message_of_the_wrong_size_is_refused(grid: GridMap) -> None:
    """A map whose numbers do not fit is no map, and one in another frame is none of `map`."""
    with pytest.raises(UsageError, match="the map has 0 values for 0 x 0 cells"):
        map_grid(OccupancyGrid())
    with pytest.raises(UsageError, match="in the frame 'odom'"):
        map_grid(msgspec.structs.replace(map_message(grid), header=Header(frame_id="/odom")))
    nowhere = Pose(Point(math.nan, 0.0, 0.0))
    for field, value, text in (
        ("width", 5, "8 values for 5 x 2"),
        ("resolution", 0.0, "resolution of 0 m"),
        ("origin", nowhere, "the origin of the map is not finite"),
    ):
        message = map_message(grid)
        setattr(message.info, field, value)
        with pytest.raises(UsageError, match=text):
            map_grid(message)


def test_it_serves_late_subscribers_until_it_is_stopped(hub: MemoryHub, grid: GridMap) -> None:
    """The process holds the name `map`, and a late subscriber gets the map too."""
    stop, found = Stop(), list[OccupancyGrid]()
    node = Node("map", hub.bus(), stop)
    thread = threading.Thread(target=run_map_server, args=(node, grid, "office.yaml"))
    thread.start()
    bus = hub.bus()
    try:
        wait_until_true(lambda: node.present)
        bus.subscribe("map", OccupancyGrid, lambda _, message: found.append(message), latched=True)
        wait_until_true(lambda: bool(found))
        assert_same(map_grid(found[0]), grid)
    finally:
        stop.request("the test is over")
        thread.join(LIMIT)
        node.close()
    assert not thread.is_alive()


@pytest.mark.parametrize("mode", ["scale", "raw"])
def test_saved_values_come_back(hub: MemoryHub, save: Save, tmp_path: Path, grid: GridMap, mode: str) -> None:
    """What `save` writes in the modes that keep each value is read as what was on the bus, such as a costmap."""
    publisher = hub.bus().publisher("robot_1/global_costmap/costmap", OccupancyGrid, latched=True)
    publisher.put(map_message(grid))
    assert save(tmp_path / "saved", "--topic", "robot_1/global_costmap/costmap", "--mode", mode) == 0
    assert_same(read_map(tmp_path / "saved.yaml"), grid)


@pytest.mark.parametrize("fmt", ["pgm", "png"])
def test_saved_maps_are_files_of_map_server(
    served: None, save: Save, tmp_path: Path, grid: GridMap, fmt: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A YAML file and a picture; free, occupied and unknown as the default thresholds say."""
    assert save(tmp_path / "saved.yaml", "--fmt", fmt) == 0
    told = f"4 x 2 cells of 0.05 m: {tmp_path}/saved.yaml, {tmp_path}/saved.{fmt}\n"
    assert capsys.readouterr().out == told
    expected = [[0, 100, -1, -1], [100, 0, -1, -1]]
    assert_same(read_map(tmp_path / "saved.yaml"), make_map(np.array(expected, np.int8), 0.05, grid.frame.origin))


def test_thresholds_decide_what_is_free_and_occupied(served: None, save: Save, tmp_path: Path) -> None:
    """Up to --free a cell is free, from --occupied on it is occupied."""
    assert save(tmp_path / "saved", "--free", "0.3", "--occupied", "0.64") == 0
    np.testing.assert_array_equal(read_map(tmp_path / "saved.yaml").cells, [[0, 100, -1, 0], [100, 0, 0, 100]])


def test_no_map_is_an_error_with_a_way_out(save: Save, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """After --timeout it says that nothing publishes one, and where to look."""
    assert save(tmp_path / "saved", "--timeout", "0.05") == 1
    told = capsys.readouterr().err
    assert "no map on map within 0.05 s: nothing publishes map: no key has" in told
    assert told.endswith("; start zteam-sim WORLD or zteam-map MAP.yaml\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--free", "0.7"], "--free 0.7, --occupied 0.65: the first is to be below the second"),
        (["--free", "25"], "--free: '25': give a share from 0 to 1"),
        (["--mode", "scale", "--fmt", "pgm"], "--mode scale marks unknown cells by transparency"),
    ],
)
def test_bad_command_lines(
    save: Save, tmp_path: Path, words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and one line that says what to give."""
    with pytest.raises(SystemExit) as ended:
        save(tmp_path / "saved", *words)
    assert ended.value.code == 2
    assert text in capsys.readouterr().err
