"""`zteam tf` on a bus in memory: what it says when something is missing, and of a frame that is taken."""

import argparse
import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.aggregator_desk import Base, Desk, S
from support.commands import exit_code
from support.named_sessions import open_named
from support.transforms import stamped
from zteam import names
from zteam.bus import MemoryHub
from zteam.cli import listening, tf
from zteam.messages import TFMessage, time_from_ns
from zteam.transforms.statistics import FrameFigures, TransformWatch

START = "no aggregator runs: start one with 'zteam-tf' (a team of 'zteam up' has one)"


@pytest.fixture(autouse=True)
def opened(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tool is on the bus in memory, and surveys are short: what is there was published before."""
    monkeypatch.setattr(tf, "open_bus", lambda _options: hub.bus())
    monkeypatch.setattr(tf, "SURVEY", 0.02)


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


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["echo", "map", "robot_0/base_link", "--timeout", "0.05"], 1),
        (["echo", "map", "robot_0/base_link", "--timeout", "0.01"], 1),
        (["echo", "map", "robot_0/base_link", "--at", "5"], 1),
        (["tree"], 0),
        (["tree", "-o", "tree.png"], 1),
        (["monitor", "--for", "0.01"], 0),
        (["positions"], 0),
        (["positions", "--once"], 0),
    ],
)
def test_without_an_aggregator_each_verb_names_it(
    words: list[str], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The answer names the command that starts an aggregator; no empty picture is drawn."""
    monkeypatch.chdir(tmp_path)
    assert tf.main(words) == code
    printed = capsys.readouterr()
    assert (printed.out + printed.err).splitlines()[-1].endswith(START)
    assert list(tmp_path.iterdir()) == []


def test_a_long_wait_for_the_aggregator_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """`tf echo` says what it waits for before its time is over."""
    assert tf.main(["echo", "map", "robot_0/base_link", "--timeout", "0.05"]) == 1
    first, _ = capsys.readouterr().err.splitlines()
    assert first == f"{START} (waiting for it; Ctrl+C to give up)"


@pytest.mark.usefixtures("desk")
def test_an_unknown_frame_is_named_with_near_ones(capsys: pytest.CaptureFixture[str]) -> None:
    """A mistyped frame is answered with the frames that may be meant."""
    assert tf.main(["echo", "mapp", "robot_0/base_lnk", "--timeout", "0.01"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "frame 'mapp' does not exist: did you mean map?; " in line
    assert "frame 'robot_0/base_lnk' does not exist: did you mean robot_0/base_link" in line
    assert line.endswith("(see 'zteam tf tree')")


@pytest.mark.parametrize("words", [["positions"], ["positions", "--once"]])
@pytest.mark.usefixtures("desk")
def test_positions_are_printed_once(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Without --rate the command ends after one table, and no zero has a sign."""
    assert tf.main(words) == 0
    assert capsys.readouterr().out == "robot_0    x    0.000  y    0.000  yaw   0.000  at 0.0 s\n"
    assert tf.main([*words, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["robot"], row["x"]) == ("robot_0", pytest.approx(-0.0002))


@pytest.mark.usefixtures("hub")
def test_figures_fit_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The table of `zteam tf monitor` is no wider than 80 columns, and its columns of numbers align right."""
    figures = [
        FrameFigures("robot_0/odom", "robot_0/base_footprint", 9, 10.0, 0.00012, 0.0, 0.0),
        FrameFigures("robot_10/odom", "robot_10/base_footprint", 9, 9.5, 0.012, 0.1, 0.25),
    ]
    monkeypatch.setattr(TransformWatch, "figures", lambda _watch: figures)
    assert tf.main(["monitor", "--for", "0.01"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines] == ["frame", "robot_0/base_footprint", "robot_10/base_footprint"]
    assert {len(line) for line in lines} == {len(lines[0])}


@pytest.mark.usefixtures("desk")
def test_the_number_of_frames_counts_the_root(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The line names the file and all frames that are drawn."""
    path = tmp_path / "tree.pdf"
    assert tf.main(["tree", "-o", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: 6 frames\n"
    assert path.read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("parent", "child", "text"),
    [
        (
            "map",
            "robot_0/odom",
            "sim publishes map -> robot_0/odom already, on robot_0/tf_static: to set a start pose, put it into",
        ),
        (
            "robot_0/base_footprint",
            "/robot_0/base_link",
            "sim publishes robot_0/base_footprint -> robot_0/base_link already, on robot_0/tf_static: nothing is left",
        ),
        ("map", "robot_0/arm", "sim publishes robot_0/base_link -> robot_0/arm already, on robot_0/tf:"),
        ("map", "table", "the team file of zteam-tf has map -> table already: change it there"),
        ("table", "map", "closes a loop"),
    ],
)
@pytest.mark.usefixtures("desk")
def test_a_frame_that_is_taken_is_refused_with_its_publisher(
    parent: str, child: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The refusal names the process and the key that have the frame, and what to do."""
    assert tf.main(["static", "1", "0", "0", "0", "0", "0", parent, child]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("zteam tf: refused: ")
    assert text in line


def test_a_base_without_a_name_is_told_by_its_session(
    hub: MemoryHub, desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    """A publisher that is no process of zteam is named by its session."""
    base = Base(hub, 3)
    base.stand(1.0)
    assert tf.main(["static", "1", "0", "0", "0", "0", "0", "map", "robot_3/odom"]) == 1
    assert f"session {base.bus.instance} publishes map -> robot_3/odom already" in capsys.readouterr().err


def test_the_holder_of_a_frame_is_named(hub: MemoryHub, desk: Desk, capsys: pytest.CaptureFixture[str]) -> None:
    """A frame of another `zteam tf static` is refused, and the answer says that this command must end first."""
    holder = hub.bus()
    holder.declare_token(names.token_key(names.STATIC_CALLER, holder.instance))
    request = tf.parse_static(["1", "0", "0", "0", "0", "0", "map", "camera"], holder.instance)
    holder.ask(names.service_key(names.AGGREGATOR, "static"), tf.StaticReply, request)
    assert tf.main(["static", "2", "0", "0", "0", "0", "0", "map", "camera"]) == 1
    line = capsys.readouterr().err
    assert f"another 'zteam tf static', session {holder.instance} has map -> camera already: end that one" in line


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("0 0 0 180 0 0 map camera", "YAW 180 is more than a full turn; angles are radians (180 degrees are 3.1416)"),
        ("0 0 0 0 -90 0 map camera", "PITCH -90 is more than a full turn"),
        ("0 0 0 2 2 0 5 map camera", "QX QY QZ QW has the length 5.74; a rotation has the length 1"),
        ("0 0 0 0 0 0 map /map", "PARENT and CHILD are both 'map': name two frames"),
        ("map camera 0 0 0 0 0 0", "give X Y Z YAW PITCH ROLL PARENT CHILD"),
    ],
)
def test_a_transform_that_cannot_be_meant_is_refused(words: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Degrees, a quaternion that is no rotation and a frame in itself end with 2, before the bus is opened."""
    assert exit_code(tf.main, ["static", *words.split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("zteam tf static: ")
    assert text in line


def test_a_parent_without_a_publisher_is_named(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`odom` instead of `robot_0/odom` makes a tree of its own: a warning says so, and the frame holds all the same."""
    wait = tf.Waiter.wait

    def until_held(waiter: tf.Waiter, ready: Any, timeout: float | None, what: str) -> bool:
        if "holds" not in printed:
            printed.append("holds")
            return wait(waiter, ready, timeout, what)
        raise KeyboardInterrupt

    for parent, hint in (("odom", "'odom': did you mean robot_0/odom? (see"), ("robot_0/odom", "")):
        printed: list[str] = []
        monkeypatch.setattr(tf.Waiter, "wait", until_held)
        assert tf.main(["static", "1", "0", "0", "0", "0", "0", parent, "camera"]) == 0
        shown = capsys.readouterr()
        assert shown.out == f"{parent} -> camera holds until Ctrl+C\n"
        assert hint in shown.err
        assert bool(hint) is bool(shown.err)


def test_a_frame_whose_publisher_has_ended_is_shown(
    hub: MemoryHub, desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    """What `tf tree` shows can be echoed, although nothing sends it any more; where it cannot, the reason is told."""
    assert tf.main(["echo", "robot_0/base_link", "robot_0/arm", "--once"]) == 0
    assert "At time 1.000" in capsys.readouterr().out
    hub.bus().publisher("robot_0/tf", TFMessage).put(TFMessage([stamped("arm", "hand", 40 * S)]))
    assert tf.main(["echo", "map", "robot_0/hand", "--once", "--timeout", "0.01"]) == 1
    assert capsys.readouterr().err == (
        "zteam tf: no transform within 0.01 s: robot_0/arm was said last at 1.000 s, 39.0 s before the newest frame: "
        "its publisher (robot_0) has ended (see 'zteam tf tree')\n"
    )


def test_a_script_waits_for_one_transform_for_a_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--once` ends with one line where the output is no terminal; `--timeout` sets another limit."""
    monkeypatch.setattr(listening, "ONCE_LIMIT", 0.05)
    assert tf.main(["echo", "map", "robot_0/base_link", "--once"]) == 1
    assert capsys.readouterr().err == f"zteam tf: no transform within 0.05 s: {START}\n"


def test_in_a_terminal_nothing_limits_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user sees what is waited for, and has Ctrl+C; without `--once` a script has no limit either."""
    for terminal, once, limit in ((True, True, None), (False, True, 10.0), (False, False, None)):
        monkeypatch.setattr("sys.stdout.isatty", lambda is_one=terminal: is_one)
        assert listening.limit_of(argparse.Namespace(timeout=None, once=once))[0] == limit
        assert listening.limit_of(argparse.Namespace(timeout=3.0, once=once)) == (3.0, False)


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
        first = publish(range(10, 500))
        assert publish(range(500, 3000)) - first < 20_000
    finally:
        tracemalloc.stop()
    assert listener.buffer.frames()["robot_0/base_footprint"].newest == 2999 * S
