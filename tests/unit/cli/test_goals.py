"""`zteam goals`: what it shows."""

import json

import pytest

from support.fake_navigation import FakeNavigation
from zteam.bus import MemoryHub
from zteam.cli import goals
from zteam.config.resources import teams_folder
from zteam.errors import BusError
from zteam.geometry import Pose2
from zteam.messages import NavigationState
from zteam.navigation.goals import Dispatcher, FileGoal, Rounds, read_goals
from zteam.node.node import Node
from zteam.testing import run_node

State = NavigationState


def test_the_shipped_goals_are_right() -> None:
    """Each of the four robots of `zteam up navigation` has goals."""
    found = read_goals(teams_folder() / "navigation.yaml")
    assert Rounds(found).robots == [0, 1, 2, 3]


@pytest.mark.parametrize("as_json", [False, True])
def test_a_line_for_each_goal_and_the_sums_at_the_end(
    hub: MemoryHub, capsys: pytest.CaptureFixture[str], as_json: bool
) -> None:
    """Of a robot that reaches its first goal and gives the second one up; with --json one object for each goal."""
    navigation, made = FakeNavigation(hub, 1), list[Dispatcher]()
    rounds = Rounds([FileGoal(1, Pose2(3.0, 4.0, 0.0), 2), FileGoal(1, Pose2(5.0, 6.0, 0.0), 7)])

    def body(node: Node) -> None:
        made.append(Dispatcher(node, rounds))
        node.run(made[0].step)

    with run_node(body, hub, name="goals") as running, goals.open_display(made[0], as_json=as_json):
        navigation.say(State.IDLE)
        for _ in range(3):
            running.tick()
        navigation.say(State.DRIVING, left=2.25, seconds=9, recoveries=1)
        running.tick()
        assert goals.table(made[0]).splitlines()[1].split() == (
            ["robot_1", "driving", "2.2", "m", "9", "s", "1", "0", "0", "x", "3,", "y", "4,", "yaw", "0"]
        )
        navigation.say(State.SUCCEEDED)
        running.tick()
        running.tick()
        navigation.say(State.ABORTED, text="stuck")
        with pytest.raises(BusError):
            # A node that stops leaves its last tick unanswered.
            running.tick()
            running.tick()
    assert not made[0].all_reached
    first, second, *table = capsys.readouterr().out.splitlines()
    if as_json:
        ends = [json.loads(line) for line in (first, second)]
        told = [(end["line"], end["result"], end["text"]) for end in ends]
        assert (told, table) == ([(2, "succeeded", ""), (7, "failed", "stuck")], [])
        return
    assert first.startswith("robot_1: goal reached after ") and first.endswith(": x 3, y 4, yaw 0 (line 2)")
    assert second.endswith(": x 5, y 6, yaw 0: stuck (line 7)")
    assert [line.split() for line in table] == [
        ["robot", "state", "left", "time", "recoveries", "reached", "failed", "goal"],
        ["robot_1", "no", "goal", "1", "1"],
    ]
