"""`zteam goto` with a navigation by hand: what it prints while a goal lasts, and how it ends."""

import json
import threading

import pytest

from support.fake_navigation import FakeNavigation
from support.limits import LIMIT
from support.transports import wait_until_true
from zteam import names
from zteam.bus import MemoryHub
from zteam.cli import goto, live_line
from zteam.cli import main as zteam
from zteam.geometry import Pose2
from zteam.messages import NavigationState, PoseStamped, RobotStatus
from zteam.navigation import client as navigation_service
from zteam.navigation.client import goal_message

State = NavigationState


class Goto:
    """Runs the command in a thread while the test plays the robot's part."""

    def __init__(self, *words: str) -> None:
        self.code: int | None = None
        self._words = ["goto", *words]
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self.code = zteam.main(self._words)

    def end(self) -> int | None:
        """Its exit code, once it has ended."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()
        return self.code


@pytest.fixture(autouse=True)
def tools(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command finds the bus of the test."""
    monkeypatch.setattr(goto, "open_bus", lambda _options: hub.bus())


def wait_for_goal(navigation: FakeNavigation, count: int = 1) -> None:
    """Wait until navigation has taken so many goals; it says that it is there meanwhile."""

    def taken() -> bool:
        if len(navigation.goals) < count:
            navigation.say(State.IDLE)
        return len(navigation.goals) >= count

    wait_until_true(taken)


def test_a_goal_that_is_reached_ends_with_0(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """The goal is a pose in the map; the result names it, and the recoveries that it took."""
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3.5", "-2", "1.5708")
    wait_for_goal(navigation)
    navigation.say(State.SUCCEEDED, recoveries=1)
    assert run.end() == 0
    goal = navigation.goals[0]
    assert (goal.header.frame_id, goal.pose.position.x, goal.pose.position.y) == ("map", 3.5, -2.0)
    assert goal.pose.orientation.z == pytest.approx(0.70711, abs=1e-4)
    told = capsys.readouterr().out
    assert told.startswith("robot_1: goal reached after ")
    assert told.endswith(" s, 1 recovery: x 3.5, y -2, yaw 1.571\n")


@pytest.mark.parametrize(
    ("state", "text", "told"),
    [
        (State.ABORTED, "no way to the goal", "goal aborted after"),
        (State.CANCELED, "", "goal canceled after"),
    ],
)
def test_a_goal_that_is_not_reached_ends_with_1(
    hub: MemoryHub, capsys: pytest.CaptureFixture[str], state: int, text: str, told: str
) -> None:
    """The reason that navigation gives is on standard error."""
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3", "4")
    wait_for_goal(navigation)
    navigation.say(state, text=text)
    assert run.end() == 1
    output = capsys.readouterr()
    assert output.out == ""
    assert f"zteam goto: robot_1: {told}" in output.err
    assert output.err.endswith(f": {text}\n" if text else "yaw 0\n")


def test_a_robot_that_is_stopped_is_told_as_that_once(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """The goal lasts: it is waited for, and reached after the release."""
    navigation = FakeNavigation(hub, 1)
    statuses = hub.bus().publisher("robot_1/status", RobotStatus)
    run = Goto("1", "3", "4")
    wait_for_goal(navigation)
    told = ""

    def is_told() -> bool:
        nonlocal told
        statuses.put(RobotStatus(robot_id=1, is_stopped=True))
        told += capsys.readouterr().err
        return "robot_1 is stopped (zteam stop --release)" in told

    wait_until_true(is_told)
    statuses.put(RobotStatus(robot_id=1))
    navigation.say(State.SUCCEEDED)
    assert run.end() == 0
    assert (told + capsys.readouterr().err).count("is stopped") == 1


def test_another_goal_takes_its_place(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """The command ends when navigation tells of a goal that it did not send, and says which."""
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3", "4")
    wait_for_goal(navigation)
    hub.bus().publisher("robot_1/goal_pose", PoseStamped).put(goal_message(Pose2(7.0, 8.0, 0.0)))
    assert run.end() == 1
    assert capsys.readouterr().err.endswith(": another goal took its place: x 7, y 8, yaw 0\n")


def test_a_navigation_that_forgets_or_ends(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a navigation that began anew, and knows no goal, nor one that is gone keeps the user waiting."""
    monkeypatch.setattr(navigation_service, "GONE", 0.1)
    for is_gone in (False, True):
        navigation = FakeNavigation(hub, 1)
        run = Goto("1", "3", "4")
        wait_for_goal(navigation)
        if is_gone:
            navigation.end()
        else:
            navigation.say(State.IDLE, goal=PoseStamped())
        assert run.end() == 1
        if not is_gone:
            navigation.end()


def test_progress_is_told_where_a_line_cannot_be_rewritten(
    hub: MemoryHub, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line now and then has the state, metres and time that are left, recoveries, and what keeps the robot."""
    for module in (goto, live_line):
        monkeypatch.setattr(module, "PERIOD", 0.0)
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3", "4")
    wait_for_goal(navigation)
    navigation.say(State.RECOVERING, left=12.34, seconds=80, recoveries=2, text="blocked by robot_2")
    line = "robot_1: recovering, 12.3 m left, about 1 min 20 s, 2 recoveries, blocked by robot_2\n"
    errors = []

    def told() -> bool:
        errors.append(capsys.readouterr().err)
        return line in "".join(errors)

    wait_until_true(told)
    navigation.say(State.SUCCEEDED)
    assert run.end() == 0


def test_json(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Scripts get one object on standard output, however it ended."""
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3", "4", "--json")
    wait_for_goal(navigation)
    navigation.say(State.ABORTED, left=2.5, recoveries=3, text="stuck")
    assert run.end() == 1
    told = json.loads(capsys.readouterr().out)
    assert told.pop("seconds") >= 0.0
    assert told == {
        "robot": 1,
        "goal": {"x": 3.0, "y": 4.0, "yaw": 0.0},
        "result": "failed",
        "text": "stuck",
        "recoveries": 3,
        "distance_remaining": 2.5,
        "driven_by": "navigation",
    }


def test_without_waiting(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """The command ends once the goal is on its way, and not before something takes it."""
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3", "4", "--no-wait")
    wait_for_goal(navigation)
    assert run.end() == 0
    assert capsys.readouterr().out == "robot_1: goal sent: x 3, y 4, yaw 0\n"


def test_a_timeout_cancels(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The robot does not drive on unobserved: its navigation is asked to cancel, and the time is the reason."""
    time = [0.0]
    monkeypatch.setattr(goto, "monotonic", lambda: time[0])
    navigation = FakeNavigation(hub, 1)
    run = Goto("1", "3", "4", "--timeout", "5")
    wait_for_goal(navigation)
    time[0] = 5.0
    assert run.end() == 1
    assert navigation.cancels == 1
    assert capsys.readouterr().err.endswith(": not reached within 5 s\n")


def test_a_timeout_without_navigation_says_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    """The way out is in the error."""
    assert Goto("1", "3", "4", "--timeout", "0.1").end() == 1
    why = "not reached within 0.1 s (waiting for the navigation of robot_1: start 'zteam-nav --id 1')"
    assert capsys.readouterr().err.endswith(f": {why}\n")


def test_ctrl_c_cancels(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Ctrl+C cancels the robot's goal; the exit code is that of an interrupt."""
    navigation = FakeNavigation(hub, 1)

    def interrupt(*_: object) -> bool:
        wait_for_goal(navigation)
        raise KeyboardInterrupt

    monkeypatch.setattr(goto, "wait_until", interrupt)
    assert Goto("1", "3", "4").end() == 130
    assert navigation.cancels == 1
    assert capsys.readouterr().err.endswith(": x 3, y 4, yaw 0: interrupted\n")


def test_cancel(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """`--cancel` gives up whatever goal the robot has; without one it says so; without navigation it fails."""
    navigation = FakeNavigation(hub, 1)
    navigation.goals.append(PoseStamped())
    assert zteam.main(["goto", "--cancel", "1"]) == 0
    navigation.goals.clear()
    assert zteam.main(["goto", "1", "--cancel", "--json"]) == 0
    assert zteam.main(["goto", "--cancel", "2"]) == 1
    output = capsys.readouterr()
    assert output.out == 'robot_1: the goal is canceled\n{"robot":1,"canceled":false}\n'
    assert output.err == "zteam goto: robot_2 has no navigation: zteam-nav --id 2\n"


def test_a_robot_that_runs_go_to_gets_the_goal(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Without navigation the behaviour drives, and its status ends the command; the command says what drives."""
    for state in (State.SUCCEEDED, State.ABORTED):
        robot = FakeNavigation(hub, 1, go_to=True)
        run = Goto("1", "3", "4", "--json")
        wait_for_goal(robot)
        robot.say(state, text="no way" if state == State.ABORTED else "")
        assert run.end() == (0 if state == State.SUCCEEDED else 1)
        output = capsys.readouterr()
        assert "robot_1 has no navigation: its behaviour go_to drives it, by its laser alone\n" in output.err
        assert '"driven_by":"go_to"' in output.out
        robot.end()


@pytest.mark.gate
def test_a_robot_that_takes_no_goals_is_named(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """The user learns what the robot runs instead."""
    bus = hub.bus()
    bus.declare_token(names.token_key("robot_1", bus.instance))
    statuses = bus.publisher("robot_1/status", RobotStatus)
    run = Goto("1", "3", "4", "--timeout", "1")
    wait_until_true(lambda: bool(statuses.put(RobotStatus(robot_id=1, behavior="wander"))) or run.code is not None)
    assert run.end() == 1
    assert "zteam-nav --id 1'; it runs the behaviour wander, which takes no goals)" in capsys.readouterr().err


def test_navigation_wins_over_go_to(hub: MemoryHub) -> None:
    """A robot that has both gets its goals from its navigation, whichever speaks first."""
    robot, navigation = FakeNavigation(hub, 1, go_to=True), FakeNavigation(hub, 1)
    run = Goto("1", "3", "4")
    robot.say(State.IDLE)
    wait_for_goal(navigation)
    robot.say(State.SUCCEEDED)
    navigation.say(State.ABORTED, text="stuck")
    assert run.end() == 1


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["1"], "give X Y, or X Y YAW"),
        (["1", "2"], "give X Y, or X Y YAW"),
        (["1", "2", "3", "4", "5"], "give X Y, or X Y YAW"),
        (["robot_1", "2", "3"], "robot id 'robot_1' is not a whole number from 0 to 9999; give 1"),
        (["1", "2", "nan"], "pose '2 nan 0': give X Y YAW in metres and radians"),
        (["1", "2", "3", "90"], "YAW 90 is more than a full turn"),
        (["--cancel", "1", "2", "3"], "--cancel takes a robot and nothing else: zteam goto --cancel 1"),
        ([], "required: ID; usage: zteam goto ID X Y [YAW]"),
    ],
)
def test_bad_command_lines(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and one line that says what to give."""
    with pytest.raises(SystemExit) as ended:
        goto.main(words)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert text in told
    assert told.count("\n") == 1
