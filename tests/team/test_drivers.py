"""What drives a robot of a team: teleop over navigation over the behaviour, and what counts from which tick on."""

import os
import runpy
import subprocess
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from zteam import names
from zteam.bus.receiving import KeyCount
from zteam.messages import Message, RobotDriver, Twist, TwistStamped, Vector3
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

TELEOP, NAV = (names.robot_key(0, topic) for topic in (names.CMD_VEL_TELEOP, names.CMD_VEL_NAV))
LEFT, RIGHT = Twist(angular=Vector3(z=0.4)), Twist(angular=Vector3(z=-0.4))

PLANNER = """
import math
from zteam import Node, TransformListener, run
from zteam.messages import Header, Odometry, PoseStamped, String, Twist, TwistStamped, Vector3, time_from_ns
from zteam.tf import TransformException

def main(node: Node) -> None:
    nav = node.publisher("robot_1/cmd_vel_nav", TwistStamped)
    goal = node.publisher("robot_0/goal_pose", PoseStamped)
    orders = node.publisher("orders", String)
    truth, told = {}, {}
    listener = TransformListener(node)
    node.subscribe("robot_0/base_pose_ground_truth", Odometry, truth.__setitem__, every_tick=True)
    node.subscribe("localiser/offset", String, told.__setitem__)
    node.on_time_reset(told.clear)

    def step(now: int) -> None:
        if not truth:
            # It does not know yet that this is lock-step.
            return
        header = Header(time_from_ns(now), "map")
        seconds = now / 1e9
        place = truth["robot_0/base_pose_ground_truth"].pose.pose.position
        try:
            here = listener.lookup_pose2("map", "robot_1/base_footprint")[0]
        except TransformException:
            return
        turn = math.sin(seconds) + 0.3 * here.y
        if told:
            turn += float(told["localiser/offset"].data)
        if seconds % 2.0 < 1.0:
            nav.put(TwistStamped(header, Twist(Vector3(0.1 + 0.01 * place.y), Vector3(z=turn))))
        goal.put(PoseStamped(header))
        orders.put(String(f"{math.cos(3.0 * seconds)}"))

    node.run(step)

if __name__ == "__main__":
    run("planner", main)
"""

LOCALISER = """
import math
from zteam import Node, run
from zteam.messages import Header, Odometry, String, TFMessage, Transform, TransformStamped, TwistStamped, Vector3
from zteam.messages import time_from_ns

def main(node: Node) -> None:
    tf = node.publisher("robot_1/tf", TFMessage)
    offset = node.publisher("localiser/offset", String)
    odoms, heard = {}, {}
    node.subscribe("robot_1/odom", Odometry, odoms.__setitem__, every_tick=True)
    node.subscribe("robot_1/cmd_vel_nav", TwistStamped, heard.__setitem__)
    node.on_time_reset(heard.clear)

    def step(now: int) -> None:
        if now <= 100_000_000 or not odoms:
            return
        drift = 0.2 * math.sin(2e-9 * now)
        if heard:
            drift += heard["robot_1/cmd_vel_nav"].twist.linear.x
        # As AMCL: valid for some time to come.
        header = Header(time_from_ns(now + 150_000_000), "map")
        tf.put(TFMessage([TransformStamped(header, "robot_1/odom", Transform(Vector3(1.0, drift)))]))
        offset.put(String(str(drift)))

    node.run(step)

if __name__ == "__main__":
    run("localiser", main)
"""

OBEDIENT = """
from zteam import Behavior
from zteam.messages import PoseStamped, RobotStatus, String, Twist, Vector3, ns_from_time

class Obedient(Behavior):
    inputs = {
        "goal": ("goal_pose", PoseStamped),
        "orders": ("/orders", String),
        "team": ("robot_$*/status", RobotStatus),
    }
    def step(self, view):
        goal, orders = view.inputs["goal"], view.inputs["orders"]
        leaders = [status.leader for status in view.inputs["team"].values()]
        age = (view.now - ns_from_time(goal.header.stamp)) / 1e9 if goal else 0.5
        turn = float(orders.data) if orders else 0.3
        here = view.lookup("map", f"robot_{view.robot_id}/base_footprint")
        turn += 0.2 * here[0].y if here else 0.0
        return Twist(Vector3(0.1 * age + 0.03 * len(leaders) + 0.02 * len(view.team)), Vector3(z=turn))
"""


def send(team: TeamFixture, key: str, message: Message) -> None:
    """Publish a message from outside; it has been received when this returns."""

    before = received(team, key)
    team.bus.publisher(key, type(message)).put(message)
    team.wait_for(lambda: received(team, key) > before)


def received(team: TeamFixture, key: str) -> int:
    """How many messages with this key the simulator has received from outside, or in real time robot 0, those that it
    dropped included."""
    name = names.SIMULATOR if team.sim.status().lockstep else names.robot_name(0)
    counts = team.bus.ask(names.stats_key(name), dict[str, KeyCount])
    count = counts.get(key, KeyCount())
    return count.received + count.dropped


def driver_of(team: TeamFixture) -> str:
    """What drives robot 0, as it says itself."""
    status = team.robot(0).status
    return "" if status is None else status.driver


@pytest.mark.parametrize("in_process", [True, False])
def test_teleop_drives_over_navigation_over_the_behaviour(team: TeamFixture, in_process: bool) -> None:
    """Each source drives for 0.5 s of simulated time after its last velocity, then the next one does; what is no number
    changes nothing; and each velocity from outside is counted in the report."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.1}}, in_process=in_process)
    team.wait_for_go()
    team.run(0.3)
    assert driver_of(team) == RobotDriver.BEHAVIOR
    send(team, NAV, TwistStamped(twist=RIGHT))
    send(team, TELEOP, LEFT)
    drivers: list[str] = []
    yaws = [team.robot(0).pose.yaw]
    for tick in range(1, 11):
        team.run(0.1)
        if tick == 3:
            send(team, NAV, TwistStamped(twist=RIGHT))
            send(team, TELEOP, Twist(Vector3(float("nan")), Vector3(z=9.0)))
        expected = RobotDriver.TELEOP if tick <= 5 else RobotDriver.NAVIGATION if tick <= 8 else RobotDriver.BEHAVIOR
        team.wait_for(lambda expected=expected: driver_of(team) == expected)  # type: ignore[misc]
        drivers.append(driver_of(team))
        yaws.append(team.robot(0).pose.yaw)
    assert drivers == [RobotDriver.TELEOP] * 5 + [RobotDriver.NAVIGATION] * 3 + [RobotDriver.BEHAVIOR] * 2
    # A command moves the robot in the tick after the one that it answers.
    assert yaws[6] > yaws[1] + 0.1
    assert yaws[9] < yaws[6] - 0.05
    assert team.report.external_commands == 4


def test_nothing_drives_before_go(team: TeamFixture) -> None:
    """The gate holds teleop too: a robot whose team is not complete stands, whatever is sent to it."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.spawn("zteam-robot", "--id", "0", name="robot_0")
    team.spawn("zteam-monitor", "--ids", "0", "1", name=names.MONITOR)
    team.wait_for_processes(names.SIMULATOR, "robot_0", names.MONITOR)
    team.wait_for(lambda: team.robot(0).status is not None and team.robot(0).status.is_ready)
    team.sim.pause()
    commands, scans = team.robot(0).commands, names.robot_key(0, names.BASE_SCAN)
    send(team, TELEOP, Twist(Vector3(0.3)))
    for _ in range(5):
        before = received(team, scans)
        team.sim.step()
        team.wait_for(lambda least=before: received(team, scans) > least)  # type: ignore[misc]
    assert (team.robot(0).commands, driver_of(team)) == (commands, RobotDriver.NONE)
    assert team.robot(0).distance_travelled == 0.0


def test_participants_drive_alike_in_processes_and_in_one(
    team: TeamFixture, same_team: TeamFixture, empty_folder: Path
) -> None:
    """A planner and a localiser that take part give the same run with processes, in one process and after a reset: what
    they publish in a tick counts from the next tick on, for robots, for frames and for each other, with a stamp and
    without, and nothing of it is external."""
    for name, text in (("planner", PLANNER), ("localiser", LOCALISER), ("own_obedient", OBEDIENT)):
        (empty_folder / f"{name}.py").write_text(text)
    nodes = {name: runpy.run_path(f"{name}.py")["main"] for name in ("planner", "localiser")}
    start = partial(dict, robots=2, behavior="own_obedient:Obedient", follow={1: 0})
    same_team.start("arena", **start(nodes=nodes, in_process=True))
    found = [outcomes(same_team)]
    with ExitStack() as stack:
        for name in nodes:
            command = [sys.executable, f"{name}.py"]
            process = stack.enter_context(subprocess.Popen(command, env={**os.environ, **team.environment}))
            stack.callback(process.terminate)
        team.start("arena", **start(expect=[*nodes]))
        found.append(outcomes(team))
    assert found[0] == found[1]
    assert found[0][0] == found[0][1]


def outcomes(team: TeamFixture) -> list[str]:
    """The hashes of a run and of that after a reset; nothing in them was external."""
    found = []
    team.wait_for_go()
    for _ in range(2):
        team.run(6.0)
        report = team.report
        assert report.external_commands == 0
        assert all(robot.distance_m > 0.3 for robot in report.robots)
        found.append(report.trajectory_sha256)
        team.sim.reset()
    return found
