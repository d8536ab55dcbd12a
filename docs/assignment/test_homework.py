"""Grades the file homework.py beside this one: pytest test_homework.py"""

from pathlib import Path

from homework import racer

from zteam import Behavior, View
from zteam.messages import Twist
from zteam.testing import Team

AVOIDER = """
[team]
world = "arena"

[[robots]]
id = 0
behavior = "homework:Avoider"
safety = false  # nothing but the homework keeps it from the walls
"""
LINE = """
[team]
world = "arena"
world_robots = false

[[robots]]
id = 0
pose = [-1.0, 0.0, 0.0]
model = "erratic"
behavior = "path"
waypoints = [[-1.0, 0.0], [3.3, 0.0], [3.3, 3.5]]
speed = 0.3

[[robots]]
id = 1
pose = [-2.0, 0.6, 0.0]
model = "erratic"
behavior = "homework:Follower"

[[robots]]
id = 2
pose = [-2.0, -0.6, 0.0]
model = "erratic"
behavior = "homework:Follower"
"""


class Referee(Behavior):
    """A robot that stands. It is ready, and so the team may start, when it has heard the whistle."""

    has_heard = False

    def missing(self, view: View) -> list[str]:
        return [] if Referee.has_heard else ["the whistle"]

    def step(self, view: View) -> Twist:
        return Twist()


def launch(team: Team, folder: Path, text: str) -> None:
    (folder / "team.toml").write_text(text)
    team.launch(folder / "team.toml", in_process=True)
    team.wait_for_go()


def test_1_avoid_obstacles(team: Team, tmp_path: Path) -> None:
    launch(team, tmp_path, AVOIDER)
    team.run(40)  # simulated seconds
    robot = team.report.robots[0]
    assert robot.stalls == 0, "robot_0 drove against something: stop or turn while the scan shows something near"
    assert robot.distance_m > 3.0, "robot_0 hardly drove: when it has turned away, it must drive on"


def test_2_start_together(team: Team) -> None:
    Referee.has_heard = False
    behavior = f"{__name__}:Referee"
    team.start("arena", robots=[0], behavior=behavior, nodes={"robot_1": racer}, lockstep=False, in_process=True)
    team.run(1.5)
    assert team.robot(1).distance_travelled < 0.01, "robot_1 drove before GO: call node.run(step, gate=True)"
    status = team.robot(1).status
    assert status is not None, "robot_1 never said that it is ready: call node.run(step, gate=True)"
    assert status.is_ready, f"robot_1 is not ready: {status.text}"
    Referee.has_heard = True
    team.wait_for_go()
    team.run(1.5)
    assert team.robot(1).distance_travelled > 0.1, "robot_1 does not drive after GO: step must return a velocity"


def test_3_drive_in_line(team: Team, tmp_path: Path) -> None:
    launch(team, tmp_path, LINE)
    team.run(15)
    for robot in (1, 2):
        gap = team.robot(robot).distance_to(robot - 1)
        assert gap < 1.5, f"robot_{robot} has lost robot_{robot - 1}: turn to it and drive up to it"
        assert gap > 0.6, f"robot_{robot} crowds robot_{robot - 1}: keep 0.8 m"
