"""A recorded run is replayed in a process of its own, and tools see it as a team."""

import json
import subprocess
import sys
from pathlib import Path

from zteam import Recording, names
from zteam.record.client import ReplayClient
from zteam.team.testing.team import TeamFixture


def test_tools_see_a_replay(team: TeamFixture, empty_folder: Path) -> None:
    """Topics, transforms and names are those of the run at the time that is asked for; beside a living one it ends."""
    record = ["up", "line", "--in-process", "--lockstep", "--for", "3", "--record", "run.mcap"]
    made = subprocess.run([sys.executable, "-m", "zteam", *record], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    team.spawn("zteam", "replay", "run.mcap", "--pause", name=names.REPLAY)
    team.wait_for_processes(names.REPLAY, names.SIMULATOR, "robot_3")
    client = ReplayClient(team.bus)
    assert client.seek(2.0).now == 2_000_000_000
    poses = {round(time, 6): (x, y) for time, x, y, _ in Recording("run.mcap").poses(3)}
    nodes = json.loads(team.command("node", "list", "--json").stdout)
    assert {"replay", "sim", "tf", "monitor", "robot_0", "robot_3"} <= {node["name"] for node in nodes}
    place = team.command("tf", "echo", "map", "robot_3/base_footprint", "--once", "--json")
    found = json.loads(place.stdout)
    assert found["header"]["stamp"] == {"sec": 2, "nanosec": 0}
    at = found["transform"]["translation"]
    # By its odometry, which has errors.
    assert abs(at["x"] - poses[2.0][0]) + abs(at["y"] - poses[2.0][1]) < 0.1
    assert client.set_speed(0.5).speed == 0.5
    client.resume()
    scan = team.command("topic", "echo", "robot_1/base_scan", "--once", "--json")
    assert json.loads(scan.stdout)["header"]["frame_id"] == "robot_1/base_laser_link"
    refused = team.command("sim", "reset")
    assert (refused.returncode, "this is a recording" in refused.stderr) == (1, True)
    second = team.spawn("zteam", "replay", "run.mcap", name="second")
    assert team.wait_for_exit(second) == 1
    assert "is taken by process" in "\n".join(team.lines(second))
    assert team.stop(names.REPLAY) == 0
