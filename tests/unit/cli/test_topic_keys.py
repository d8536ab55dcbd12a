"""`zteam topic list`, `info` and `echo` on a bus in memory: keys with their publishers and subscribers."""

import json

import pytest

from support.named_sessions import ignore, open_named
from zteam import names
from zteam.bus import MemoryHub, NoRequest, graph
from zteam.bus.graph import near_keys, rate_of
from zteam.bus.memory import MemoryTransport
from zteam.bus.presence import own_info
from zteam.cli import listening, topic
from zteam.messages import Bool, Odometry, Twist, encode, encoding_of


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> MemoryHub:
    """The bus of the tool and of everything else; a survey is short, because what is on the bus is latched."""
    hub = MemoryHub()
    monkeypatch.setattr(topic, "open_bus", lambda _options: hub.bus())
    for module in (graph, listening):
        monkeypatch.setattr(module, "SURVEY", 0.05)
    return hub


@pytest.fixture
def team(hub: MemoryHub) -> MemoryHub:
    """A simulator of two robots that takes commands, a latched map of its own, and one silent robot process."""
    simulator = open_named(hub, "sim")
    for robot_id in (0, 1):
        simulator.publisher(names.robot_key(robot_id, names.ODOM), Odometry)
    simulator.subscribe_raw("robot_$*/cmd_vel", ignore)
    simulator.publisher("lamp", Bool, latched=True).put(Bool(True))
    robot = open_named(hub, "robot_1")
    robot.publisher("robot_1/cmd_vel", Twist)
    robot.subscribe_raw("robot_1/odom", ignore)
    # As a recorder does.
    hub.bus().subscribe_raw("**", ignore)
    return hub


def test_the_list_has_keys_without_data(team: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """A key is listed if it has a publisher or a subscriber; a wildcard over the robots is a key of each robot."""
    assert topic.main(["list"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "key              type                        rate  pubs  subs",
        "lamp             std_msgs/msg/Bool        latched     1     1",
        "robot_0/cmd_vel  geometry_msgs/msg/Twist        -     0     2",
        "robot_0/odom     nav_msgs/msg/Odometry          -     1     1",
        "robot_1/cmd_vel  geometry_msgs/msg/Twist        -     1     2",
        "robot_1/odom     nav_msgs/msg/Odometry          -     1     2",
    ]


def test_the_list_as_json_names_the_processes(team: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Scripts get the names of publishers and subscribers; the tool itself is none of them."""
    assert topic.main(["list", "--json"]) == 0
    rows = {row["key"]: row for row in json.loads(capsys.readouterr().out)}
    recorder = rows["lamp"]["subscribers"][0]
    assert recorder.startswith("session ")
    assert rows["robot_0/cmd_vel"]["publishers"] == []
    assert rows["robot_0/cmd_vel"]["subscribers"] == [recorder, "sim"]
    assert rows["robot_1/odom"]["publishers"] == ["sim"]
    assert rows["robot_1/odom"]["subscribers"] == ["robot_1", recorder]
    assert rows["lamp"]["publishers"] == ["sim"]


def test_a_foreign_program_is_known_by_what_it_publishes(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """A session that tells no declarations is a publisher, beside others, when it is heard; else it is missing."""
    foreign = MemoryTransport(hub)
    foreign.declare_publisher("lamp", encoding_of(Bool), True).put(encode(Bool(False)))
    foreign.declare_publisher("bell", encoding_of(Bool), False)
    open_named(hub, "sim").publisher("lamp", Bool)
    assert topic.main(["list", "--json"]) == 0
    rows = {row["key"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["lamp"]["publishers"] == [f"session {foreign.instance}", "sim"]
    assert "bell" not in rows


def test_info_of_a_key_without_a_publisher(team: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """It says that there is no writer, and names the receivers."""
    assert topic.main(["info", "robot_0/cmd_vel"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == ["robot_0/cmd_vel", "  type      geometry_msgs/msg/Twist", "  rate      -", "  writer    none"]
    assert lines[5:] == ["  receiver  sim"]


def test_info_of_a_silent_publisher(team: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """A publisher of which nothing is heard is named as such."""
    assert topic.main(["info", "robot_1/cmd_vel"]) == 0
    assert "  writer    robot_1 (nothing heard of it)\n" in capsys.readouterr().out
    assert topic.main(["info", "lamp"]) == 0
    assert "  writer    sim\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("robt_0/odom", ": did you mean robot_0/odom or robot_1/odom?"),
        ("cmd_vel", ": did you mean robot_0/cmd_vel or robot_1/cmd_vel?"),
        ("nothing/like/it", ": see 'zteam topic list'"),
    ],
)
def test_info_of_an_unknown_key_names_near_ones(
    key: str, hint: str, hub: MemoryHub, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mistyped key is answered with the keys that may be meant."""
    bus = open_named(hub, "sim")
    for robot_id in (0, 1):
        bus.publisher(names.robot_key(robot_id, names.ODOM), Odometry)
        bus.subscribe_raw(names.robot_key(robot_id, names.CMD_VEL), ignore)
    assert topic.main(["info", key]) == 1
    assert capsys.readouterr().err == f"zteam topic: nothing publishes {key} or subscribes to it{hint}\n"


def test_an_empty_bus_is_told(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Without any process the list and `info` say so."""
    assert topic.main(["list"]) == 0
    assert capsys.readouterr().out.startswith("no key has a publisher or a subscriber (is a simulator running?")
    assert topic.main(["info", "lamp"]) == 1
    assert "no key has a publisher or a subscriber" in capsys.readouterr().err


@pytest.mark.parametrize("verb", [["echo", "--timeout", "0.2"], ["echo", "--timeout", "0.01"]])
@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("robot_2/odom", "nothing publishes robot_2/odom: did you mean robot_0/odom or robot_1/odom?"),
        ("robot_0/cmd_vel", "nothing publishes robot_0/cmd_vel: did you mean robot_1/cmd_vel?"),
        ("robot_1/cmd_vel", "robot_1/cmd_vel is published by robot_1, but nothing has come yet"),
    ],
)
def test_echo_tells_why_nothing_comes(
    key: str, text: str, verb: list[str], team: MemoryHub, capsys: pytest.CaptureFixture[str]
) -> None:
    """It distinguishes a key without a publisher from a silent one; with a longer time-out before it ends, too."""
    assert topic.main([verb[0], key, *verb[1:]]) == 1
    told = capsys.readouterr().err.splitlines()
    assert told[-1].endswith(f" s: {text}")
    assert told[:-1] in ([f"{text} (waiting for a message; Ctrl+C to give up)"], [])
    assert (len(told) == 2) is (verb[-1] == "0.2")


def test_the_rate_of_a_survey_is_that_between_messages() -> None:
    """A survey that ends between two messages shows the rate of the messages, not one of its own length."""
    assert rate_of([5.0, 5.25, 5.5], 1000.0) == 4.0
    assert rate_of([5.0], 2.0) == 0.5
    assert rate_of([], 2.0) == 0.0


def test_near_keys_end_alike_or_are_spelt_alike() -> None:
    """A topic without its robot is found in every robot; anything else by its spelling, the nearest first."""
    known = ["robot_0/odom", "robot_1/odom", "tf", "robot_0/base_scan"]
    assert near_keys("scan", known) == ": did you mean robot_0/base_scan?"
    assert near_keys("robot_1", known) == ": did you mean robot_1/odom?"
    assert near_keys("odom", known) == ": did you mean robot_0/odom or robot_1/odom?"
    assert near_keys("robot_0/base_scn", known) == ": did you mean robot_0/base_scan?"
    assert near_keys("robot_0/odm", ["robot_0/log", *known]).startswith(": did you mean robot_0/odom or ")
    assert near_keys("camera", known) == ""


@pytest.mark.gate
def test_a_session_of_several_names_is_shown_by_the_robots_own(
    hub: MemoryHub, capsys: pytest.CaptureFixture[str]
) -> None:
    """One process that navigates three robots is nav_2 on the keys of robot 2, and its first name elsewhere."""
    bus = open_named(hub, "nav_1")
    for robot_id in (2, 3):
        info = own_info(names.navigation_name(robot_id), bus.instance, 0)
        bus.serve(names.info_key(info.name), NoRequest, lambda _, info=info: info)
        bus.declare_token(names.token_key(info.name, bus.instance))
    for key in ("robot_1/near", "robot_2/near", "near"):
        bus.publisher(key, Bool, latched=True).put(Bool(True))
    shown = {}
    for key in ("robot_1/near", "robot_2/near", "near"):
        assert topic.main(["info", key, "--json"]) == 0
        row = json.loads(capsys.readouterr().out)
        shown[key] = row["writers"], row["publishers"]
    assert shown == {
        "robot_1/near": (["nav_1"], ["nav_1"]),
        "robot_2/near": (["nav_2"], ["nav_2"]),
        "near": (["nav_1"], ["nav_1"]),
    }


@pytest.mark.parametrize(("verb", "what"), [("echo", "message"), ("hz", "two messages")])
@pytest.mark.usefixtures("team")
def test_a_script_waits_for_one_message_for_a_time(
    verb: str, what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--once` ends with one line and exit code 1 where the output is no terminal."""
    monkeypatch.setattr(listening, "ONCE_LIMIT", 0.1)
    assert topic.main([verb, "robot_0/odom", "--once"]) == 1
    silent = "robot_0/odom is published by sim, but nothing has come yet"
    assert capsys.readouterr().err == f"zteam topic: no {what} on robot_0/odom within 0.1 s: {silent}\n"
