"""The tools against a running team."""

import json
import math
from pathlib import Path

import pytest

from support.transports import wait_until_true
from zteam import names
from zteam.team.testing.team import TeamFixture
from zteam.transforms.client import find_frames

pytestmark = pytest.mark.team


def check_topic_tools(team: TeamFixture) -> None:
    """`topic echo`, `list` and `info` print the messages, types and writers of a running team."""
    scan = team.command("topic", "echo", "/robot_0/base_scan", "--once", "--json")
    assert scan.returncode == 0
    message = json.loads(scan.stdout)
    assert message["header"]["frame_id"] == "robot_0/base_laser_link"
    assert len(message["ranges"]) == 1081

    grid = json.loads(team.command("topic", "echo", "map", "--once", "--json").stdout)
    assert len(grid["data"]) == grid["info"]["width"] * grid["info"]["height"]

    rows = {row["key"]: row for row in json.loads(team.command("topic", "list", "--json").stdout)}
    assert rows["robot_1/cmd_vel"]["type"] == "geometry_msgs/msg/Twist"
    assert rows["tf_static"]["type"] == "tf2_msgs/msg/TFMessage"
    # In lock-step the simulator publishes what the robots answer.
    assert rows["robot_1/cmd_vel"]["publishers"] == ["robot_1", "sim"]
    assert rows["robot_1/cmd_vel"]["subscribers"] == ["sim"]
    assert rows["robot_1/base_scan"]["subscribers"] == ["robot_1"]
    assert rows["robot_1/tf"]["subscribers"] == ["tf"]

    info = json.loads(team.command("topic", "info", "robot_1/base_scan", "--json").stdout)
    assert info["writers"] == ["sim"]
    assert info["receivers"]["robot_1"]["received"] > 0


def check_tf_tools(team: TeamFixture, drawn: Path) -> None:
    """`tf echo`, `tree`, `positions` and `monitor` print the transforms of a running team."""
    pose = json.loads(team.command("tf", "echo", "/map", "robot_0/base_footprint", "--once", "--json").stdout)
    truth = team.robot(0).pose
    where = pose["transform"]["translation"]
    assert math.dist((where["x"], where["y"]), truth[:2]) < 0.5

    tree = json.loads(team.command("tf", "tree", "--json").stdout)
    assert tree["robot_1/base_footprint"]["parent"] == "robot_1/odom"
    assert tree["robot_1/odom"]["authority"] == names.SIMULATOR

    places = {row["robot"]: row for row in json.loads(team.command("tf", "positions", "--json").stdout)}
    assert set(places) == {"robot_0", "robot_1"}
    assert math.dist((places["robot_1"]["x"], places["robot_1"]["y"]), team.robot(1).pose[:2]) < 0.5

    watched = json.loads(team.command("tf", "monitor", "--for", "2", "--json").stdout)
    moving = {row["child"]: row for row in watched["frames"]}
    assert moving["robot_0/base_footprint"]["authority"] == "robot_0"
    assert moving["robot_0/base_footprint"]["rate"] == pytest.approx(10.0, abs=1.2)
    assert watched["conflicts"] == []

    past = team.command("tf", "echo", "map", "robot_0/base_footprint", "--at", f"{team.now - 1.0:.1f}", "--json")
    assert json.loads(past.stdout)["header"]["stamp"]["sec"] >= 1
    assert team.command("tf", "tree", "-o", str(drawn)).returncode == 0
    assert "robot_1/base_laser_link" in drawn.read_text()


def check_node_tools(team: TeamFixture) -> None:
    """`node list` and doctor print the processes of a running team."""
    nodes = {row["name"]: row["pid"] for row in json.loads(team.command("node", "list", "--json").stdout)}
    assert nodes["robot_1"] == team.pid("robot_1")
    assert set(nodes) == {"sim", "tf", "monitor", "robot_0", "robot_1"}

    doctor = team.command("doctor", "--json")
    assert doctor.returncode == 0, doctor.stdout
    assert all(finding["good"] for finding in json.loads(doctor.stdout))


def test_the_tools_see_a_running_team(team: TeamFixture, tmp_path: Path) -> None:
    """Every tool prints the state of the same team as JSON (one team, because its start is slow)."""
    slow = {0: {"speed": 0.05}, 1: {"speed": 0.05}}
    team.start("arena", robots="0-1", behavior="forward", params=slow)
    team.wait_for_go()
    # Some of a second's past is asked for.
    team.run(2.0)
    team.sim.set_speed(1.0)
    team.sim.resume()
    check_topic_tools(team)
    check_tf_tools(team, tmp_path / "frames.svg")
    check_node_tools(team)


@pytest.mark.real_time
def test_two_writers_of_one_command_are_reported(team: TeamFixture) -> None:
    """`topic info`, doctor and the monitor report both writers, and the monitor reports when one of them has ended."""
    team.start("arena", behavior="forward", params={0: {"speed": 0.05}}, lockstep=False)
    team.wait_for_go()
    team.spawn("zteam", "topic", "pub", "robot_0/cmd_vel", "Twist", "{}", "--rate", "20", name="pub")
    team.wait_for_line(names.MONITOR, "robot_0 is commanded by 2 processes: ")
    line = next(line for line in team.lines(names.MONITOR) if "is commanded by 2" in line)
    assert "robot_0 (process " in line

    info = json.loads(team.command("topic", "info", "robot_0/cmd_vel", "--json").stdout)
    assert len(info["writers"]) == 2
    assert "robot_0" in info["writers"]
    shown = team.command("topic", "info", "robot_0/cmd_vel").stdout
    assert "  writer    robot_0\n" in shown
    assert "  writer    session " in shown

    doctor = team.command("doctor", "--json")
    assert doctor.returncode == 1
    (finding,) = (row for row in json.loads(doctor.stdout) if row["what"] == "commands")
    assert finding["text"].startswith("robot_0/cmd_vel has 2 writers: ")
    team.stop("pub")
    team.wait_for_line(names.MONITOR, "robot_0 is commanded by one process again")


@pytest.mark.real_time
def test_a_published_message_arrives(team: TeamFixture) -> None:
    """`topic pub` moves a robot without a process, and sends its last message before it ends."""
    team.spawn("zteam-sim", "arena", name="sim")
    team.wait_for_processes("sim")
    start = team.robot(0).commands
    listed = json.loads(team.command("topic", "list", "--json").stdout)
    (row,) = (row for row in listed if row["key"] == "robot_0/cmd_vel")
    assert (row["count"], row["publishers"]) == (0, [])
    assert "sim" in row["subscribers"]
    done = team.command(
        "topic", "pub", "-r", "10", "robot_0/cmd_vel", "Twist", "[0, 0, 0]", "[0, 0, 0.5]", "--times", "5"
    )
    assert done.returncode == 0
    # The fixture subscribes as well.
    assert done.stdout.startswith("publishing geometry_msgs/msg/Twist on robot_0/cmd_vel 5 times at 10 Hz to 2 ")
    assert done.stdout.endswith(", sim\n")
    assert done.stderr == ""
    team.wait_for(lambda: team.robot(0).commands >= start + 5 and team.robot(0).pose.yaw > 0.1)
    assert team.robot(0).commands == start + 5


def test_a_static_transform_lives_as_long_as_its_caller(team: TeamFixture) -> None:
    """`zteam tf static` adds a frame until the command ends."""
    team.spawn("zteam-tf", name="tf")
    team.wait_for_processes("tf")
    arguments = ("static", "-0.1", "0", "0.2", "0", "0", "0", "map", "table")
    team.spawn("zteam", "tf", *arguments, name="static")
    team.wait_for_line("static", "holds until")
    seen = json.loads(team.command("tf", "echo", "map", "table", "--once", "--json", "--timeout", "20").stdout)
    assert seen["transform"]["translation"]["x"] == -0.1
    team.stop("static")
    # The aggregator waits a moment before it drops a vanished caller.
    wait_until_true(lambda: "table" not in (find_frames(team.bus) or {}))
    gone = team.command("tf", "echo", "map", "table", "--once", "--timeout", "1")
    assert gone.returncode == 1
    assert "does not exist" in gone.stderr
