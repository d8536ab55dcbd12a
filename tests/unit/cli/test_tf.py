"""`zteam tf` on a bus in memory: what it shows, and what it says of frames that are missing or taken."""

import argparse
import json
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from support.aggregator_desk import Base, Desk, S
from support.commands import Run
from support.named_sessions import open_named
from support.transforms import stamped
from zteam import names
from zteam.bus import MemoryHub
from zteam.cli import listening, tf
from zteam.messages import TFMessage, time_from_ns
from zteam.transforms.statistics import FrameFigures, TransformWatch

START = "no aggregator runs: start one with 'zteam-tf' (a team of 'zteam up' has one)"
pytestmark = pytest.mark.usefixtures("tools")


@pytest.fixture
def desk(hub: MemoryHub) -> Iterator[Desk]:
    """An aggregator with a table from its team file, and the simulator's robot 0."""
    desk = Desk(hub, (stamped("map", "table", 0),))
    simulator = open_named(hub, names.SIMULATOR)
    moving = simulator.publisher("robot_0/tf", TFMessage)
    fixed = simulator.publisher("robot_0/tf_static", TFMessage, latched=True)
    base = stamped("odom", "base_footprint", 0, -2.0002)
    fixed.put(TFMessage([stamped("map", "odom", 0, 2.0), base, stamped("base_footprint", "base_link", 0)]))
    desk.node.bus.declare_token(names.token_key(names.AGGREGATOR, desk.node.bus.instance))
    desk.start()
    moving.put(TFMessage([stamped("base_link", "arm", S)]))
    yield desk
    desk.end()


@pytest.mark.usefixtures("empty_folder")
def test_without_an_aggregator_each_verb_names_it(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The answer names the command that starts one, `echo` says so before its time is over, and nothing is drawn."""
    monkeypatch.setattr(listening, "ONCE_LIMIT", 0.05)
    for words, code in (
        ("echo map robot_0/base_link --timeout 0.01", 1),
        ("echo map robot_0/base_link --at 5", 1),
        ("echo map robot_0/base_link --once", 1),
        ("tree", 0),
        ("tree -o tree.png", 1),
        ("monitor --for 0.01", 0),
        ("positions", 0),
    ):
        (line,) = "".join(run(f"zteam tf {words}", code)).splitlines()
        assert line.endswith(START)
    first, _ = run("zteam tf echo map robot_0/base_link --timeout 0.05", 1).err.splitlines()
    assert first == f"{START} (waiting for it; Ctrl+C to give up)"
    assert list(Path().iterdir()) == []


@pytest.mark.usefixtures("desk")
def test_an_unknown_frame_is_named_with_near_ones(run: Run) -> None:
    """A mistyped frame is answered with the frames that may be meant."""
    (line,) = run("zteam tf echo mapp robot_0/base_lnk --timeout 0.01", 1).err.splitlines()
    assert "frame 'mapp' does not exist: did you mean map?; " in line
    assert "frame 'robot_0/base_lnk' does not exist: did you mean robot_0/base_link" in line
    assert line.endswith("(see 'zteam tf tree')")


@pytest.mark.usefixtures("desk")
def test_positions_are_printed_once(run: Run) -> None:
    """Without --rate the command ends after one table, and no zero has a sign."""
    assert run("zteam tf positions").out == "robot_0    x    0.000  y    0.000  yaw   0.000  at 0.0 s\n"
    (row,) = json.loads(run("zteam tf positions --json").out)
    assert (row["robot"], row["x"]) == ("robot_0", pytest.approx(-0.0002))


def test_positions_are_known_while_the_world_stands_still(hub: MemoryHub, run: Run) -> None:
    """What moves has said its pose before the tool began, and says nothing new: the aggregator has it."""
    with closing(hub.bus()) as stopped:
        desk = Desk(hub)
        moving = stopped.publisher("robot_0/tf", TFMessage)
        desk.node.bus.declare_token(names.token_key(names.AGGREGATOR, desk.node.bus.instance))
        desk.start()
        moving.put(TFMessage([stamped("map", "base_footprint", 3 * S, 2.5)]))
        try:
            assert run("zteam tf positions").out == "robot_0    x    2.500  y    0.000  yaw   0.000  at 3.0 s\n"
        finally:
            desk.end()


def test_figures_fit_a_terminal(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """The table of `zteam tf monitor` is no wider than 80 columns, and its columns of numbers align right."""
    figures = [
        FrameFigures("robot_0/odom", "robot_0/base_footprint", 9, 10.0, 0.00012, 0.0, 0.0),
        FrameFigures("robot_10/odom", "robot_10/base_footprint", 9, 9.5, 0.012, 0.1, 0.25),
    ]
    monkeypatch.setattr(TransformWatch, "figures", lambda _watch: figures)
    lines = run("zteam tf monitor --for 0.01").out.splitlines()
    assert max(map(len, lines)) <= 80
    assert " ".join(lines[2].split()) == "robot_10/base_footprint unknown 9.5 Hz 12.0 ms 100.0 ms 250.0 ms"
    assert {len(line) for line in lines} == {len(lines[0])}


@pytest.mark.usefixtures("desk")
def test_the_tree_is_drawn(tmp_path: Path, run: Run) -> None:
    """The line names the file and all frames that are drawn, the root too."""
    path = tmp_path / "tree.pdf"
    assert run(f"zteam tf tree -o {path}").out == f"{path}: 6 frames\n"
    assert path.read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("frames", "text"),
    [
        ("map robot_0/odom", "sim publishes robot_0/odom already: a start pose belongs in [[static_transforms]]"),
        ("map robot_0/arm", "robot_0 publishes robot_0/arm already: name another child"),
        ("map table", "team_file publishes table already: change it there"),
        ("table map", "closes a loop"),
        ("map robot_3/odom", "session:{base} publishes robot_3/odom already: a start"),
        ("map camera", "{holder} publishes camera already: end that process or name another child"),
    ],
)
@pytest.mark.usefixtures("desk")
def test_a_frame_that_is_taken_is_refused_with_its_publisher(frames: str, text: str, hub: MemoryHub, run: Run) -> None:
    """The refusal names the process, or the session of one without a name, and what to do."""
    base, holder = Base(hub, 3), hub.bus()
    base.stand(1.0)
    holder.declare_token(names.token_key(names.STATIC_CALLER, holder.instance))
    request = tf.parse_static(["1", "0", "0", "0", "0", "0", "map", "camera"], holder.instance)
    holder.ask(names.service_key(names.AGGREGATOR, "static"), tf.StaticReply, request)
    (line,) = run(f"zteam tf static 1 0 0 0 0 0 {frames}", 1).err.splitlines()
    assert line.startswith("zteam tf: refused: ")
    assert text.format(base=base.bus.instance, holder=holder.instance) in line


@pytest.mark.parametrize(
    ("words", "rotation"),
    [("1 2 3 3.14159265 0 0", (0, 0, 1, 0)), ("1 2 3 0 0 3.14159265", (1, 0, 0, 0)), ("1 2 3 0 1 0 0", (0, 1, 0, 0))],
)
def test_a_static_transform_has_angles_or_a_quaternion(words: str, rotation: tuple[float, ...]) -> None:
    """Yaw, pitch and roll, or x, y, z, w."""
    request = tf.parse_static([*words.split(), "map", "/camera"], "")
    found = (request.parent, request.child, request.x, request.y, request.z)
    assert found == ("map", "camera", 1.0, 2.0, 3.0)
    assert (request.qx, request.qy, request.qz, request.qw) == pytest.approx(rotation, abs=1e-6)


@pytest.mark.usefixtures("desk")
def test_a_parent_without_a_publisher_is_named(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """`odom` instead of `robot_0/odom` makes a tree of its own: a warning says so, and the frame holds all the same."""
    wait = tf.Waiter.wait

    def until_held(waiter: tf.Waiter, ready: Any, timeout: float | None, what: str) -> bool:
        if "holds" not in printed:
            printed.append("holds")
            return wait(waiter, ready, timeout, what)
        raise KeyboardInterrupt

    monkeypatch.setattr(tf.Waiter, "wait", until_held)
    for parent, hint in (("odom", "'odom': did you mean robot_0/odom? (see"), ("robot_0/odom", "")):
        printed: list[str] = []
        out, err = run(f"zteam tf static 1 0 0 0 0 0 {parent} camera")
        assert out == f"{parent} -> camera holds until Ctrl+C\n"
        assert hint in err and bool(hint) is bool(err)


@pytest.mark.usefixtures("desk")
def test_a_frame_whose_publisher_has_ended_is_shown(hub: MemoryHub, run: Run) -> None:
    """What `tf tree` shows can be echoed, although nothing sends it any more; where it cannot, the reason is told."""
    assert "At time 1.000" in run("zteam tf echo robot_0/base_link robot_0/arm --once").out
    hub.bus().publisher("robot_0/tf", TFMessage).put(TFMessage([stamped("arm", "hand", 40 * S)]))
    error = run("zteam tf echo map robot_0/hand --once --timeout 0.01", 1).err
    assert error.startswith("zteam tf: no transform within 0.01 s: there is no data between 'map' and")
    assert error.endswith("(see 'zteam tf tree')\n")


def test_in_a_terminal_nothing_limits_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user sees what is waited for, and has Ctrl+C; without `--once` a script has no limit either."""
    for terminal, once, limit in ((True, True, None), (False, True, 10.0), (False, False, None)):
        monkeypatch.setattr("sys.stdout.isatty", lambda is_one=terminal: is_one)
        assert listening.limit_of(argparse.Namespace(timeout=None, once=once)) == limit
        assert listening.limit_of(argparse.Namespace(timeout=3.0, once=once)) == 3.0


def test_the_memory_of_a_listener_is_bounded(hub: MemoryHub) -> None:
    """Once the buffer's ten seconds are full, a listener that runs for days needs no more memory."""
    listener, publisher = tf.TreeListener(hub.bus()), hub.bus().publisher(names.TF, TFMessage)
    transform = stamped("map", "robot_0/base_footprint", 0)

    def publish(ticks: range) -> int:
        for tick in ticks:
            transform.header.stamp = time_from_ns(tick * S)
            publisher.put(TFMessage([transform]))
        return tracemalloc.get_traced_memory()[0]

    publish(range(1, 10))
    tracemalloc.start()
    try:
        first = publish(range(10, 200))
        assert publish(range(200, 1000)) - first < 20_000
    finally:
        tracemalloc.stop()
    assert listener.buffer.frames()["robot_0/base_footprint"].newest == 999 * S
