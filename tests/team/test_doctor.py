"""`zteam doctor` against teams with something wrong."""

import json
import socket
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from support.transports import RouterProcess
from zteam import BusOptions, connect, names
from zteam.bus.receiving import KeyCount
from zteam.messages import Header, LaserScan, MapMetaData, OccupancyGrid, Point, Pose, Range
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

SLOW = {0: {"speed": 0.05}, 1: {"speed": 0.05}}


def doctor(team: TeamFixture, *words: str) -> tuple[int, list[dict[str, Any]]]:
    """Exit code and findings."""
    done = team.command("doctor", "--json", *words)
    return done.returncode, json.loads(done.stdout)


def problems(team: TeamFixture, *words: str) -> dict[str, str]:
    """Text and next step of each problem, by its subject."""
    code, found = doctor(team, *words)
    bad = {row["what"]: f"{row['text']} -> {row['next_step']}" for row in found if not row["good"]}
    assert code == (1 if bad else 0), found
    return bad


def open_bus(team: TeamFixture) -> Any:
    """A session of the test's own in the team."""
    return connect(BusOptions(team.environment["ZTEAM_CONNECT"], team.environment["ZTEAM_NAMESPACE"]))


def check_pause(team: TeamFixture) -> None:
    """The pause alone is told, and is gone when the world goes on."""
    assert team.command("sim", "pause").returncode == 0
    told = problems(team)
    assert list(told) == ["world"]
    assert told["world"].startswith("the simulator is paused at ")
    assert told["world"].endswith(" -> zteam sim resume")
    assert team.command("sim", "resume").returncode == 0


def check_maps(team: TeamFixture, folder: Path) -> None:
    """A map file and a published map that are shifted by 3 m are told with the shift."""
    world = team.sim_status.map
    assert world is not None
    Image.new("L", (world.columns, world.rows), 254).save(folder / "lab.pgm")
    origin = [world.x + 3.0, world.y, 0.0]
    (folder / "lab.yaml").write_text(f"image: lab.pgm\nresolution: {world.resolution}\norigin: {origin}\n")
    assert "shifted by +3.00 m in x" in problems(team, "--map", str(folder / "lab.yaml"))["map file"]

    bus = open_bus(team)
    try:
        corner = Pose(Point(world.x + 3.0, world.y, 0.0))
        info = MapMetaData(resolution=world.resolution, width=world.columns, height=world.rows, origin=corner)
        cells = np.zeros(world.columns * world.rows, np.int8)
        publisher = bus.publisher(names.MAP, OccupancyGrid, latched=True)
        publisher.put(OccupancyGrid(Header(frame_id="map"), info, cells))
        assert "(newer than that of sim)" in problems(team)["map"]
        assert "shifted by +3.00 m in x" in problems(team)["map"]
    finally:
        bus.close()


def refused(team: TeamFixture) -> int:
    """How many scans robot 1 has refused."""
    return team.bus.ask(names.stats_key("robot_1"), dict[str, KeyCount])["robot_1/base_scan"].dropped


def check_refusals(team: TeamFixture) -> None:
    """A message of the wrong type is told with its sender's session and the process that refuses it."""
    bus = open_bus(team)
    try:
        publisher = bus.publisher("robot_1/base_scan", Range)
        team.wait_for(lambda: publisher.has_subscribers)
        publisher.put(Range())
        team.wait_for(lambda: refused(team) == 1)
        listed = team.command("topic", "info", "robot_1/base_scan", "--json")
        count = json.loads(listed.stdout)["receivers"]["robot_1"]
        assert count["last_drop_age"] < 60.0
        assert count["last_drop_reason"] == f"wrong type: it is {Range.ros_type}, {LaserScan.ros_type} is due"
        told = problems(team)["refusals"]
        assert told.startswith("robot_1/base_scan: robot_1: 1 refused, ")
        assert f"wrong type: it is {Range.ros_type}" in told
    finally:
        bus.close()


def test_doctor_names_causes_in_a_running_team(team: TeamFixture, tmp_path: Path) -> None:
    """A pause, shifted maps and refused messages are each told with cause and next step, all in one team."""
    team.start("arena", robots=2, behavior="forward", params=SLOW)
    team.wait_for_go()
    team.sim.set_speed(1.0)
    team.sim.resume()
    assert problems(team) == {}
    check_pause(team)
    check_maps(team, tmp_path)
    check_refusals(team)


@pytest.mark.real_time
def test_doctor_names_what_a_team_lacks(team: TeamFixture) -> None:
    """An id that the world lacks, a gate that waits for it, and the wrong namespace are named."""
    team.spawn("zteam-sim", "arena", name="sim")
    team.spawn("zteam-monitor", "--ids", "0,7", name="monitor")
    team.spawn("zteam-robot", "--id", "7", name="robot_7")
    team.wait_for_processes("sim", "monitor", "robot_7")
    # The monitor asks the simulator for its robots a moment after it has come.
    team.wait_for(lambda: team.status is not None and "not in the world" in team.status.waiting_for)
    told = problems(team)
    assert "the world arena has no robot 7 (it has 0, 1)" in told["robots"]
    assert told["gate"].startswith("the start gate waits for robot_0, robot_7 (0 of 2 ready)")
    assert told["gate"].endswith("the world has no robot 7: zteam-monitor --ids 0,1")
    assert told["transforms"] == "no process tf -> zteam-tf"

    missing = problems(team, "--namespace", "elsewhere")
    assert list(missing) == ["namespace"]
    assert "there are processes in the namespace " in missing["namespace"]
    assert "monitor, robot_7, sim" in missing["namespace"]


@pytest.mark.real_time
@pytest.mark.parametrize("place", ["an empty router", "another program"])
def test_doctor_names_the_router_where_the_team_is(team: TeamFixture, place: str) -> None:
    """Where no processes are, the other routers of this machine are told with their processes."""
    team.spawn("zteam-sim", "arena", name="sim")
    team.wait_for_processes("sim")
    with ExitStack() as ends:
        if place == "an empty router":
            empty = RouterProcess()
            ends.callback(empty.kill)
            endpoint = empty.endpoint
        else:
            server = ends.enter_context(socket.create_server(("127.0.0.1", 0)))
            endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}"
        code, found = doctor(team, "--connect", endpoint)
    told = {row["next_step"]: row["text"] for row in found if row["what"] == "router"}
    assert code == 1
    text = told[f"--connect {team.endpoint} (or export ZTEAM_CONNECT={team.endpoint})"]
    assert text == f"another router of this machine, at {team.endpoint}, has processes: {team.namespace}/sim"


def test_doctor_names_what_holds_lock_step(team: TeamFixture) -> None:
    """A frozen robot holds the world, and both are told; a world that goes on has no problem."""
    team.start("arena", robots=2, behavior="forward", params=SLOW, lockstep_timeout=600.0)
    team.wait_for_go()
    team.pause_process("robot_1")
    team.sim.resume()
    team.wait_for(lambda: team.sim_status.waiting_for == "robot_1")
    told = problems(team)
    assert "it waits for robot_1" in told["world"]
    assert told["process"].startswith("robot_1 is alive but does not answer: it is stopped")
    team.resume_process("robot_1")
    stuck = team.sim_status.tick
    team.wait_for(lambda: team.sim_status.tick > stuck + 1)
    assert problems(team) == {}
