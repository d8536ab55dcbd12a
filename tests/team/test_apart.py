"""The processes of a team file one by one, as containers run them."""

import shlex
from pathlib import Path

import yaml

from zteam.testing import Team

TEAM = """
[team]
world = "arena"

[[robots]]
id = 0
behavior = "mine:Slow"

[[robots]]
id = 1
follow = 0

[[nodes]]
name = "heard"
command = ["python", "heard.py"]
"""
BEHAVIOR = """
from zteam.behaviors import Behavior
from zteam.messages import Twist, Vector3


class Slow(Behavior):
    def step(self, view):
        return Twist(linear=Vector3(x=0.2))
"""
NODE = """
from zteam import run

run("heard", lambda node: node.run(lambda now: None))
"""


def test_each_process_of_a_team_file_runs_alone(team: Team, tmp_path: Path) -> None:
    """What the compose file of a team starts is the team: own behaviours, nodes and files are found from any folder."""
    for name, text in (("team.toml", TEAM), ("mine.py", BEHAVIOR), ("heard.py", NODE)):
        (tmp_path / name).write_text(text)
    made = team.command("up", str(tmp_path / "team.toml"), "--compose")
    services = yaml.safe_load(made.stdout)["services"]
    assert list(services) == ["router", "sim", "tf", "monitor", "robot_0", "robot_1", "heard"]
    del services["router"]
    for name, service in services.items():
        words = shlex.split(service["command"].replace("/team/", f"{tmp_path}/").replace("${ZTEAM_UP_ARGS:-}", ""))
        team.spawn(*words, name=name)
    team.wait_for_processes(*services)
    team.wait_for_go()
    team.until(lambda: team.robot(1).distance_travelled > 0.3, within=60)
