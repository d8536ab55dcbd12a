"""How each process of a team behaves when other processes start, end, die or misbehave."""

import math

import pytest
import zenoh

from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.messages import Twist, Vector3, encode
from zteam.team.testing.team import TeamFixture
from zteam.transforms.client import TransformClient

pytestmark = pytest.mark.team


def test_a_refused_simulator_leaves_no_trace(team: TeamFixture) -> None:
    """A second simulator, in another world, publishes nothing before it is refused: the team's transforms stay."""
    team.start("arena", robots=1)
    team.wait_for_go()
    heard: set[tuple[str, str]] = set()
    team.bus.subscribe_raw("**", lambda sample: heard.add((sample.key, sample.source)), latched=True)
    start = team.robot(0).pose
    second = team.spawn("zteam-sim", "office", name="second")
    assert team.wait_for_exit(second) == 1
    assert "sim is taken by process" in "\n".join(team.lines(second))
    team.run(1.0)
    known = {info.instance for _, info in team.bus.query(names.info_key("*"), ProcessInfo)}
    assert [key for key, source in sorted(heard) if source not in known and key != names.log_key(names.SIMULATOR)] == []
    start_pose = TransformClient(team.bus).lookup_transform("map", "robot_0/odom", 0).transform.translation
    assert (start_pose.x, start_pose.y) == pytest.approx((start.x, start.y))


@pytest.mark.real_time
def test_a_bare_twist_moves_its_robot(team: TeamFixture, outsider: zenoh.Session) -> None:
    """CDR bytes from a plain Zenoh client, without encoding or attachment, move robot 1 alone."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)
    team.wait_for(lambda: math.isfinite(team.robot(1).speed))
    here = team.robot(0).pose
    payload = encode(Twist(Vector3(0.0), Vector3(0.0, 0.0, 0.5)))
    start = team.robot(1).pose.yaw

    def turned() -> bool:
        outsider.put(f"{team.namespace}/robot_1/cmd_vel", payload)
        return abs(team.robot(1).pose.yaw - start) > 0.2

    team.wait_for(turned)
    assert team.robot(0).pose == here


def test_a_lost_router_is_no_lost_robot(team: TeamFixture) -> None:
    """When the router dies, the monitor reports the router and no robot as lost."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}})
    team.wait_for_go()
    team.kill("router")
    team.wait_for_line(names.MONITOR, "router lost")
    assert not any("robot_0 lost" in line for line in team.lines(names.MONITOR))
    assert team.exit_code("robot_0") is None
