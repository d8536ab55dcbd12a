"""Lock-step with a world outside: whatever comes from there is one of the inputs of a tick, for all alike."""

import threading
from pathlib import Path

import pytest

from support.outside import send
from zteam import names
from zteam.clock import pause
from zteam.messages import NavigationState, PoseStamped, String, Tick, Twist, Vector3
from zteam.robot.client import ParametersClient
from zteam.team.testing.team import TeamFixture

WITNESS = """
from zteam import Node
from zteam.messages import String

def main(node: Node) -> None:
    heard = []
    node.subscribe("chat", String, lambda key, message: heard.append(message.data))
    node.subscribe("motto", String, lambda key, message: heard.append(message.data), latched=True)
    node.subscribe("robot_1/*/*", String, lambda key, message: heard.append(message.data))

    def step(now: int) -> None:
        with open(f"{node.name}.txt", "a") as file:
            print(now, *heard, file=file)
        heard.clear()

    node.run(step)
"""
WITNESSES = ("ann", "bob", "cid")


def start(team: TeamFixture, folder: Path, *, in_process: bool) -> None:
    """Two robots and the witnesses, which write into `folder`."""
    (folder / "witness.py").write_text(WITNESS)
    nodes = dict.fromkeys(WITNESSES, "witness:main")
    team.start("arena", robots=2, behavior="forward", params={0: {"speed": 0.1}}, nodes=nodes, in_process=in_process)
    team.wait_for_go()


def take_logs(folder: Path) -> list[list[str]]:
    """What each of the witnesses has written: a line a tick, with what was heard in it."""
    found = []
    for name in WITNESSES:
        path = folder / f"{name}.txt"
        found.append(path.read_text().splitlines())
        path.unlink()
    return found


@pytest.mark.gate
def test_a_run_with_a_world_outside_repeats(team: TeamFixture, same_team: TeamFixture, empty_folder: Path) -> None:
    """Velocities, messages, a parameter, a stop, a robot that comes and one that is moved act in the tick that carries
    them: with processes and in one process the run is the same, and each of them is counted."""
    found = []
    for each, in_process in ((team, False), (same_team, True)):
        start(each, empty_folder, in_process=in_process)
        for number in range(3):
            each.run(0.5)
            send(each, "chat", String(f"word_{number}"))
            send(each, "robot_0/cmd_vel_teleop", Twist(Vector3(0.1), Vector3(z=0.5 + number)))
        each.run(1.0)
        assert ParametersClient(each.bus).set("robot_1", {"speed": 0.3})["speed"] == 0.3
        each.run(1.0)
        each.stop(robots=[1])
        each.run(0.5)
        each.release([1])
        each.sim.move(0, 0.5, 0.5, 1.0)
        each.run(1.0)
        report, logs = each.report, take_logs(empty_folder)
        assert logs[0] == logs[1] == logs[2]
        assert [line.split()[1:] for line in logs[0] if " " in line] == [[f"word_{number}"] for number in range(3)]
        found.append((report.trajectory_sha256, report.external_commands, logs[0]))
    assert found[0] == found[1]
    # Three words, three velocities, a parameter, a stop, a release and a move.
    assert found[0][1] == 10


@pytest.mark.gate
@pytest.mark.parametrize("in_process", [True, False])
def test_all_act_in_the_same_tick(team: TeamFixture, empty_folder: Path, *, in_process: bool) -> None:
    """While the world runs as fast as it can, each message from outside reaches all its readers in one tick, in order,
    and the ticks carry all of them, numbered."""
    start(team, empty_folder, in_process=in_process)
    ticks: dict[int, Tick] = {}
    team.bus.subscribe(names.TICK, Tick, lambda _, tick: ticks.setdefault(tick.tick, tick))
    over = threading.Event()

    def chat() -> None:
        publisher = team.bus.publisher("chat", String)
        for number in range(200):
            publisher.put(String(str(number)))
            pause(0.002)
        over.set()

    thread = threading.Thread(target=chat)
    thread.start()
    while not over.is_set():
        team.run(1.0)
    thread.join()
    team.run(0.2)
    logs = take_logs(empty_folder)
    assert logs[0] == logs[1] == logs[2]
    heard = [word for line in logs[0] for word in line.split()[1:]]
    # A message may be dropped on its way, for all alike.
    assert heard == sorted(set(heard), key=int)
    assert len(heard) > 150
    words = [each for number in sorted(ticks) for each in ticks[number].inputs if each.key == "chat"]
    assert [each.number for each in words] == sorted({each.number for each in words})


def test_a_goal_in_a_paused_world_acts_in_the_next_step(team: TeamFixture) -> None:
    """What comes until a tick opens is in it."""
    team.start("arena", robots=1, behavior="go_to")
    team.wait_for_go()
    team.run(0.5)
    pose = team.robot(0).pose
    goal = PoseStamped()
    goal.header.frame_id = names.MAP_FRAME
    goal.pose.position.x, goal.pose.position.y = pose.x + 0.5, pose.y
    send(team, "robot_0/goal_pose", goal)
    team.run(0.1)
    team.wait_for(
        lambda: team.robot(0).status is not None and team.robot(0).status.goal_state == NavigationState.DRIVING
    )


def test_a_message_is_no_request(team: TeamFixture, empty_folder: Path) -> None:
    """A message on the key of a query stops no robot: it reaches who reads the key, as any other."""
    start(team, empty_folder, in_process=False)
    send(team, "robot_1/stop/engage", String("a message"))
    before = team.robot(1).pose
    team.run(2.0)
    assert abs(team.robot(1).pose.x - before.x) + abs(team.robot(1).pose.y - before.y) > 0.3
    assert [line for line in take_logs(empty_folder)[0] if "a message" in line]
