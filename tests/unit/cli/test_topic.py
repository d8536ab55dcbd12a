"""`zteam topic list`, `info` and `echo` on a bus in memory: keys with their publishers and subscribers."""

import json

import pytest

from support.commands import Run
from support.named_sessions import ignore, open_named
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.bus.graph import near_keys, rate_of
from zteam.bus.memory import MemoryTransport
from zteam.bus.presence import own_info
from zteam.cli import listening
from zteam.messages import Bool, Odometry, Twist, encode, encoding_of


@pytest.fixture
def team(tools: MemoryHub) -> MemoryHub:
    """A simulator of two robots that takes commands, a latched map of its own, and one silent robot process."""
    simulator = open_named(tools, "sim")
    for robot_id in (0, 1):
        simulator.publisher(names.robot_key(robot_id, names.ODOM), Odometry)
    simulator.subscribe_raw("robot_$*/cmd_vel", ignore)
    simulator.publisher("lamp", Bool, latched=True).put(Bool(True))
    robot = open_named(tools, "robot_1")
    robot.publisher("robot_1/cmd_vel", Twist)
    robot.subscribe_raw("robot_1/odom", ignore)
    # As a recorder does.
    tools.bus().subscribe_raw("**", ignore)
    return tools


@pytest.mark.usefixtures("team")
def test_the_list_has_keys_without_data(run: Run) -> None:
    """A key is listed if it has a publisher or a subscriber; a wildcard over the robots is a key of each robot."""
    assert run("zteam topic list").out.splitlines() == [
        "key              type                        rate  pubs  subs",
        "lamp             std_msgs/msg/Bool        latched     1     1",
        "robot_0/cmd_vel  geometry_msgs/msg/Twist        -     0     2",
        "robot_0/odom     nav_msgs/msg/Odometry          -     1     1",
        "robot_1/cmd_vel  geometry_msgs/msg/Twist        -     1     2",
        "robot_1/odom     nav_msgs/msg/Odometry          -     1     2",
    ]
    rows = {row["key"]: row for row in json.loads(run("zteam topic list --json").out)}
    recorder = rows["lamp"]["subscribers"][0]
    assert recorder.startswith("session ")
    users = {key: (rows[key]["publishers"], rows[key]["subscribers"]) for key in ("robot_0/cmd_vel", "robot_1/odom")}
    assert users == {"robot_0/cmd_vel": ([], [recorder, "sim"]), "robot_1/odom": (["sim"], ["robot_1", recorder])}


def test_a_foreign_program_is_known_by_what_it_publishes(tools: MemoryHub, run: Run) -> None:
    """A session that answers with no declarations is a publisher once a message of it arrives."""
    foreign = MemoryTransport(tools)
    foreign.declare_publisher("lamp", encoding_of(Bool), True).put(encode(Bool(False)))
    foreign.declare_publisher("bell", encoding_of(Bool), False)
    open_named(tools, "sim").publisher("lamp", Bool)
    rows = {row["key"]: row for row in json.loads(run("zteam topic list --json").out)}
    assert rows["lamp"]["publishers"] == [f"session {foreign.instance}", "sim"]
    assert "bell" not in rows


@pytest.mark.usefixtures("team")
def test_info_names_writers_and_receivers(run: Run) -> None:
    """It says that there is none, or that nothing is heard of it."""
    lines = run("zteam topic info robot_0/cmd_vel").out.splitlines()
    assert lines[:4] == ["robot_0/cmd_vel", "  type      geometry_msgs/msg/Twist", "  rate      -", "  writer    none"]
    assert lines[5:] == ["  receiver  sim"]
    assert "  writer    robot_1 (nothing heard of it)\n" in run("zteam topic info robot_1/cmd_vel").out
    assert "  rate      latched, 5 bytes\n  writer    sim\n" in run("zteam topic info lamp").out


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("robt_0/odom", ": did you mean robot_0/odom or robot_1/odom?"),
        ("nothing/like/it", ": see 'zteam topic list'"),
    ],
)
@pytest.mark.usefixtures("team")
def test_info_of_an_unknown_key_names_near_ones(key: str, hint: str, run: Run, tools: MemoryHub) -> None:
    """A mistyped key is answered with the keys that may be meant."""
    assert run(f"zteam topic info {key}", 1).err == (
        f"zteam topic: nothing publishes {key} or subscribes to it{hint}\n"
    )


@pytest.mark.usefixtures("tools")
def test_an_empty_bus_is_told(run: Run) -> None:
    """Without any process the list and `info` say so."""
    told = "no key has a publisher or a subscriber (is a simulator running?"
    assert run("zteam topic list").out.startswith(told)
    assert told in run("zteam topic info lamp", 1).err


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("robot_2/odom", "nothing publishes robot_2/odom: did you mean robot_1/odom or robot_0/odom?"),
        ("robot_0/cmd_vel", "nothing publishes robot_0/cmd_vel: did you mean robot_1/cmd_vel?"),
        ("robot_1/cmd_vel", "robot_1/cmd_vel is published by robot_1, but nothing has come yet"),
    ],
)
@pytest.mark.usefixtures("team")
def test_echo_tells_why_nothing_comes(key: str, text: str, run: Run) -> None:
    """It distinguishes a key without a publisher from a silent one; with a longer time-out before it ends, too."""
    (line,) = run(f"zteam topic echo {key} --timeout 0.01", 1).err.splitlines()
    assert line == f"zteam topic: no message on {key} within 0.01 s: {text}"
    first, second = run(f"zteam topic echo {key} --timeout 0.1", 1).err.splitlines()
    assert first == f"{text} (waiting for a message; Ctrl+C to give up)"
    assert second == f"zteam topic: no message on {key} within 0.1 s: {text}"


@pytest.mark.parametrize(("verb", "what"), [("echo", "message"), ("hz", "two messages")])
@pytest.mark.usefixtures("team")
def test_a_script_waits_for_one_message_for_a_time(
    verb: str, what: str, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    """`--once` ends with one line and exit code 1 where the output is no terminal."""
    monkeypatch.setattr(listening, "ONCE_LIMIT", 0.05)
    silent = "robot_0/odom is published by sim, but nothing has come yet"
    line = f"zteam topic: no {what} on robot_0/odom within 0.05 s: {silent}\n"
    assert run(f"zteam topic {verb} robot_0/odom --once", 1).err == line


def test_a_message_that_cannot_be_decoded_is_not_the_one(
    tools: MemoryHub, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    """`--once` waits for another one, for as long as for the first."""
    monkeypatch.setattr(listening, "ONCE_LIMIT", 0.05)
    MemoryTransport(tools).declare_publisher("robot_0/odom", encoding_of(Odometry), True).put(b"xx")
    first, second = run("zteam topic echo robot_0/odom --once", 1).err.splitlines()
    assert first.startswith("robot_0/odom: undecodable: ")
    assert second.startswith("zteam topic: no message on robot_0/odom within 0.05 s: ")


def test_the_rate_of_a_survey_is_that_between_messages() -> None:
    """A survey that ends between two messages shows the rate of the messages, not one of its own length."""
    assert [rate_of([5.0, 5.25, 5.5], 1000.0), rate_of([5.0], 2.0), rate_of([], 2.0)] == [4.0, 0.5, 0.0]


def test_near_keys_end_alike_or_are_spelt_alike() -> None:
    """A topic without its robot is found in every robot; anything else by its spelling, the nearest first."""
    known = ["robot_0/odom", "robot_1/odom", "tf", "robot_0/base_scan"]
    assert near_keys("scan", known) == ": did you mean robot_0/base_scan?"
    assert near_keys("robot_1", known) == ": did you mean robot_1/odom?"
    assert near_keys("odom", known) == ": did you mean robot_0/odom or robot_1/odom?"
    assert near_keys("robot_0/base_scn", known) == ": did you mean robot_0/base_scan?"
    assert near_keys("robot_0/odm", ["robot_0/log", *known]).startswith(": did you mean robot_0/odom or ")
    assert near_keys("camera", known) == ""


def test_a_session_of_several_names_is_shown_by_the_robots_own(tools: MemoryHub, run: Run) -> None:
    """One process that navigates three robots is nav_2 on the keys of robot 2, and its first name elsewhere."""
    bus = open_named(tools, "nav_1")
    for robot_id in (2, 3):
        info = own_info(names.navigation_name(robot_id), bus.instance, 0)
        bus.serve(names.info_key(info.name), NoRequest, lambda _, info=info: info)
        bus.declare_token(names.token_key(info.name, bus.instance))
    for key, name in (("robot_1/near", "nav_1"), ("robot_2/near", "nav_2"), ("near", "nav_1")):
        bus.publisher(key, Bool, latched=True).put(Bool(True))
        row = json.loads(run(f"zteam topic info {key} --json").out)
        assert (row["writers"], row["publishers"]) == ([name], [name])
