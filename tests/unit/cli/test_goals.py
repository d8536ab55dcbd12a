"""`zteam goals`: its command line, and what it shows."""

import json
from pathlib import Path

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


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "FILE is missing"),
        (["f.yaml", "--spread", "a"], "--spread: 'a': give robot ids"),
        (["f.yaml", "--spread", ""], "--spread: no id is given"),
        (["f.yaml", "--rounds", "0"], "--rounds: '0': give rounds from 1"),
        (["f.yaml", "--name", "a/b"], "--name 'a/b': use letters, digits and '_'"),
    ],
)
def test_bad_command_lines(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and one line that says what to give."""
    with pytest.raises(SystemExit) as ended:
        goals.main(words)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert text in told
    assert told.count("\n") == 1


def test_a_mistake_in_the_file_is_told_before_anything_is_opened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No router is needed for it."""
    path = tmp_path / "goals.yaml"
    path.write_text("- {robot: 0, x: 1}\n")
    assert goals.main([str(path)]) == 2
    assert capsys.readouterr().err == f"goals: {path}:1: the key y is missing\n"


def test_the_shipped_goals_are_right() -> None:
    """Each of the four robots of `zteam up navigation` has goals."""
    found = read_goals(teams_folder() / "navigation.yaml")
    assert Rounds(found).robots == [0, 1, 2, 3]


def run_to_the_end(hub: MemoryHub, capsys: pytest.CaptureFixture[str], *, as_json: bool) -> str:
    """What is printed of a robot that reaches its first goal, and gives the second one up."""
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
    return capsys.readouterr().out


def test_a_line_for_each_goal_and_the_sums_at_the_end(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Where there is no terminal; each line has the line of the file."""
    first, second, *table = run_to_the_end(hub, capsys, as_json=False).splitlines()
    assert first.startswith("robot_1: goal reached after ")
    assert first.endswith(": x 3, y 4, yaw 0 (line 2)")
    assert second.endswith(": x 5, y 6, yaw 0: stuck (line 7)")
    assert [line.split() for line in table] == [
        ["robot", "state", "left", "time", "recoveries", "reached", "failed", "goal"],
        ["robot_1", "no", "goal", "1", "1"],
    ]


def test_json_lines(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """One object for each goal that has ended, and nothing else."""
    told = [json.loads(line) for line in run_to_the_end(hub, capsys, as_json=True).splitlines()]
    assert [(end["line"], end["result"], end["text"]) for end in told] == [(2, "succeeded", ""), (7, "failed", "stuck")]
