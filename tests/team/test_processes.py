"""How each process of a team behaves when other processes start, end, die or misbehave."""

import math
import os

import numpy as np
import pytest
import zenoh

from zteam import names
from zteam.bus.counters import KeyCount
from zteam.messages import Twist, Vector3, encode
from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team

FAST = {0: {"speed": 0.3}}


def test_a_killed_robot_stops_and_comes_back(team: TeamFixture) -> None:
    """The wheels stop within 0.3 simulated seconds, the monitor reports it, the others go on; a restart gets GO."""
    team.start("arena", robots=2, behavior="forward", params={0: {"speed": 0.1}, 1: {"speed": 0.1}})
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.05 and team.robot(1).speed > 0.05, within=10)
    team.kill("robot_0")
    killed = team.now
    team.until(lambda: team.robot(0).speed == 0.0, within=5)
    assert team.robot(0).truth_stamp - killed <= 0.3 + 1e-9
    team.wait_for(lambda: team.status is not None and 0 in team.status.lost)
    commands = team.robot(1).commands
    team.until(lambda: team.robot(1).commands > commands + 3, within=5)
    team.restart("robot_0")
    team.until(lambda: team.robot(0).speed > 0.05, within=10)
    assert any("robot_0 lost" in line for line in team.lines(names.MONITOR))
    team.wait_for(lambda: any("told GO" in line for line in team.lines(names.MONITOR)))


@pytest.mark.parametrize("victim", [names.AGGREGATOR, names.MONITOR])
def test_the_rest_goes_on_without(team: TeamFixture, victim: str) -> None:
    """Without the aggregator or the monitor a robot drives on, and the restarted process joins the running team."""
    team.start("arena", robots=2, behavior="forward", params={0: {"speed": 0.05}, 1: {"speed": 0.05}})
    team.wait_for_go()
    team.until(lambda: team.robot(1).speed > 0.02, within=10)
    epoch = team.status.epoch
    team.kill(victim)
    start = team.robot(1).commands
    team.until(lambda: team.robot(1).commands > start + 10, within=5)
    assert team.robot(1).speed > 0.02
    team.restart(victim)
    start = team.robot(1).commands
    team.until(lambda: team.robot(1).commands > start + 10, within=5)
    assert team.robot(1).speed > 0.02
    assert team.status.epoch == epoch


def test_a_follower_stops_without_transforms(team: TeamFixture) -> None:
    """A follower without transforms stands still, and its status gives the reason."""
    team.start("arena", robots=2, behavior="forward", follow={1: 0}, params={0: {"speed": 0.05}})
    team.wait_for_go()
    team.until(lambda: team.robot(1).distance_travelled > 0.05, within=20)
    team.kill(names.AGGREGATOR)
    team.until(lambda: team.robot(1).speed == 0.0, within=5)
    team.until(lambda: team.robot(1).status is not None and "stale" in team.robot(1).status.text, within=5)


def test_a_killed_simulator_comes_back(team: TeamFixture) -> None:
    """Simulated time begins again, and the robots drive on without a new GO."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}})
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.02, within=10)
    team.kill(names.SIMULATOR)
    team.robot(0).truth = None
    team.restart(names.SIMULATOR)
    team.until(lambda: team.robot(0).speed > 0.02, within=20)


def test_an_id_is_held_by_one_process(team: TeamFixture) -> None:
    """A second robot with the same id refuses to start and names the process that holds the id; the first drives on."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}})
    team.wait_for_go()
    second = team.spawn("zteam-robot", "--id", "0", name="second")
    assert team.wait_for_exit(second) == 1
    said = "\n".join(team.lines(second))
    assert f"robot_0 is taken by process {team.pid('robot_0')}" in said
    commands = team.robot(0).commands
    team.until(lambda: team.robot(0).commands > commands + 3, within=5)


def test_a_stopped_robot_leaves_a_zero_velocity(team: TeamFixture) -> None:
    """SIGTERM ends a robot with exit code 0; it publishes a zero velocity before it releases its name."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.1}})
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.05 and team.robot(0).command is not None, within=10)
    assert team.stop("robot_0") == 0
    assert team.robot(0).command == Twist()
    assert not team.alive("robot_0")
    team.until(lambda: team.robot(0).speed == 0.0, within=0.3)


def test_a_bare_twist_moves_its_robot(team: TeamFixture, outsider: zenoh.Session) -> None:
    """CDR bytes from a plain Zenoh client, without encoding or attachment, move robot 1 alone."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)
    team.until(lambda: math.isfinite(team.robot(1).speed), within=5)
    here = team.robot(0).pose
    payload = encode(Twist(Vector3(0.0), Vector3(0.0, 0.0, 0.5)))
    start = team.robot(1).pose.yaw

    def turned() -> bool:
        outsider.put(f"{team.namespace}/robot_1/cmd_vel", payload)
        return abs(team.robot(1).pose.yaw - start) > 0.2

    team.until(turned, within=10)
    assert team.robot(0).pose == here


GARBAGE = [b"", b"\0", b"\0\1\0\0", b"garbage on the wire", b"\0\1\0\0" + b"\xff" * 64, bytes(range(256)) * 8]
KEYS = [
    "robot_0/cmd_vel", "robot_0/cmd_vel_teleop", "robot_0/base_scan", "robot_0/odom", "robot_0/base_pose_ground_truth",
    "robot_0/stall", "robot_0/tf", "robot_0/tf_static", "robot_0/base_info", "robot_0/status", "team_status", "tf",
    "tf_static", "clock", "map", "sim/tick", "robot_0/done", "robot_99/cmd_vel", "robot_01/cmd_vel",
    "robot_$*/cmd_vel", "**",
]  # fmt: skip


def test_garbage_changes_nothing_but_the_counters(team: TeamFixture, outsider: zenoh.Session) -> None:
    """After garbage on every key all processes run, the robot stands still, and the drops are counted."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.0}})
    team.wait_for_go()
    before = team.robot(0).pose
    for key in KEYS:
        for payload in GARBAGE:
            # Blocking, so that Zenoh drops no message of the burst.
            outsider.put(f"{team.namespace}/{key}", payload, congestion_control=zenoh.CongestionControl.BLOCK)
    nan = Twist(Vector3(math.nan))
    outsider.put(f"{team.namespace}/robot_0/cmd_vel", np.frombuffer(encode(nan), np.uint8).tobytes())
    team.run(1.0)
    assert team.robot(0).pose == before
    assert [name for name in ("sim", "tf", "monitor", "robot_0") if team.exit_code(name) is not None] == []
    dropped = team.bus.ask(names.stats_key(names.SIMULATOR), dict[str, KeyCount])
    assert dropped["robot_0/cmd_vel"].dropped >= len(GARBAGE)


@pytest.mark.parametrize("text", ["abc", "1x", "-1", "99999999999999999999", "²", ""])
def test_bad_ids_are_refused(text: str) -> None:
    """A bad id ends the command with exit code 2 and one line."""
    import subprocess

    from zteam.launch.process import zteam_command

    done = subprocess.run(
        zteam_command("zteam-robot", f"--id={text}"),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ,
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "robot id" in done.stderr


def test_processes_start_in_any_order(team: TeamFixture) -> None:
    """A team whose robots and monitor start before the simulator and the aggregator gets GO too."""
    team.spawn("zteam-robot", "--id", "1", "--follow", "0", name="robot_1")
    team.spawn("zteam-monitor", "--team-size", "2", name=names.MONITOR)
    team.spawn("zteam-robot", "--id", "0", "--behavior", "forward", "--param", "speed=0.1", name="robot_0")
    team.wait_for_processes("robot_0", "robot_1", names.MONITOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.wait_for_go()
    team.until(lambda: team.robot(1).distance_travelled > 0.05, within=30)


def test_a_robot_without_gate_drives_at_once(team: TeamFixture) -> None:
    """With --no-gate, a behaviour without look-ups needs neither monitor nor aggregator."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.spawn("zteam-robot", "--id", "0", "--behavior", "forward", "--param", "speed=0.1", "--no-gate", name="robot_0")
    team.wait_for_processes(names.SIMULATOR, "robot_0")
    team.until(lambda: team.robot(0).speed > 0.05, within=20)


def test_a_lost_router_is_no_lost_robot(team: TeamFixture) -> None:
    """When the router dies, the monitor reports the router and no robot as lost."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}})
    team.wait_for_go()
    team.kill("router")
    team.wait_for_line(names.MONITOR, "router lost")
    assert not any("robot_0 lost" in line for line in team.lines(names.MONITOR))
    assert team.exit_code("robot_0") is None
