"""`zteam goto` with a navigation by hand: what it prints while a goal lasts, and how it ends."""

import json
import threading

import pytest

from support.commands import run_here
from support.fake_navigation import FakeNavigation
from support.limits import LIMIT
from support.transports import wait_until_true
from zteam import names
from zteam.bus import MemoryHub
from zteam.cli import goto
from zteam.messages import NavigationState, PoseStamped, RobotStatus
from zteam.node import live_line

pytestmark = pytest.mark.usefixtures("tools")
State = NavigationState


class Goto:
    """Runs the command in a thread while the test plays the robot's part."""

    def __init__(self, words: str, navigation: FakeNavigation | None = None) -> None:
        self.code: int | None = None
        self._words = f"zteam goto {words}"
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        if navigation is not None:
            wait_for_goal(navigation)

    def _run(self) -> None:
        self.code = run_here(self._words)

    def end(self) -> int | None:
        """Its exit code, once it has ended."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()
        return self.code


@pytest.fixture
def navigation(hub: MemoryHub) -> FakeNavigation:
    """That of robot 1."""
    return FakeNavigation(hub, 1)


def wait_for_goal(navigation: FakeNavigation) -> None:
    """Wait until navigation has taken a goal; it says that it is there meanwhile."""

    def taken() -> bool:
        if not navigation.goals:
            navigation.say(State.IDLE)
        return bool(navigation.goals)

    wait_until_true(taken)


@pytest.mark.parametrize(
    ("state", "text", "code", "told"),
    [
        (State.SUCCEEDED, "", 0, "robot_1: goal reached after "),
        (State.ABORTED, "no way to the goal", 1, "zteam goto: robot_1: goal aborted after "),
        (State.CANCELED, "", 1, "zteam goto: robot_1: goal canceled after "),
    ],
)
def test_the_end_of_a_goal(
    navigation: FakeNavigation, state: int, text: str, code: int, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The goal is a pose in the map. Its end has pose, recoveries and reason; a failure is on standard error."""
    run = Goto("1 3.5 -2 1.5708", navigation)
    navigation.say(state, text=text, recoveries=1)
    assert run.end() == code
    goal = navigation.goals[0]
    assert (goal.header.frame_id, goal.pose.position.x, goal.pose.position.y) == ("map", 3.5, -2.0)
    assert goal.pose.orientation.z == pytest.approx(0.70711, abs=1e-4)
    printed = capsys.readouterr()
    line, other = (printed.err, printed.out) if code else (printed.out, printed.err)
    assert line.startswith(told) and not other
    assert line.endswith(f" s, 1 recovery: x 3.5, y -2, yaw 1.571{f': {text}' if text else ''}\n")


def test_json(navigation: FakeNavigation, capsys: pytest.CaptureFixture[str]) -> None:
    """Scripts get one object on standard output, however it ended."""
    run = Goto("1 3 4 --frame base_link --json", navigation)
    navigation.say(State.ABORTED, left=2.5, recoveries=3, text="stuck")
    assert run.end() == 1
    told = json.loads(capsys.readouterr().out)
    assert told.pop("seconds") >= 0.0
    assert told == {
        "robot": 1, "goal": {"x": 3.0, "y": 4.0, "yaw": 0.0, "frame": "base_link"}, "result": "failed",
        "text": "stuck", "recoveries": 3, "distance_remaining": 2.5, "driven_by": "navigation",
    }  # fmt: skip


def test_what_keeps_a_robot_is_told_while_it_lasts(
    hub: MemoryHub, navigation: FakeNavigation, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line now and then has state, metres and time that are left, recoveries and reason; a stop is logged once."""
    for module in (goto, live_line):
        monkeypatch.setattr(module, "PERIOD", 0.0)
    run = Goto("1 3 4", navigation)
    navigation.say(State.RECOVERING, left=12.34, seconds=80, recoveries=2, text="blocked by robot_2")
    statuses, errors = hub.bus().publisher("robot_1/status", RobotStatus), ""

    def is_told(line: str) -> bool:
        nonlocal errors
        errors += capsys.readouterr().err
        return line in errors

    line = "robot_1: recovering, 12.3 m left, about 1 min 20 s, 2 recoveries, "
    wait_until_true(lambda: is_told(f"{line}blocked by robot_2\n"))
    statuses.put(RobotStatus(robot_id=1, is_stopped=True))
    wait_until_true(lambda: is_told(f"{line}stopped (zteam stop --release)\n"))
    statuses.put(RobotStatus(robot_id=1))
    navigation.say(State.SUCCEEDED)
    assert run.end() == 0
    assert errors.count("robot_1 is stopped (zteam stop --release): it goes on when it is released") == 1


def test_without_waiting(navigation: FakeNavigation, capsys: pytest.CaptureFixture[str]) -> None:
    """The command ends once the goal is on its way, and not before something takes it."""
    assert Goto("1 3 4 --no-wait", navigation).end() == 0
    assert capsys.readouterr().out == "robot_1: goal sent: x 3, y 4, yaw 0\n"


def test_a_pose_may_be_in_another_frame(navigation: FakeNavigation, capsys: pytest.CaptureFixture[str]) -> None:
    """The goal names the frame, and so does the line of its end."""
    command = Goto("1 2 0 --frame base_link --no-wait", navigation)
    assert command.end() == 0
    assert navigation.goals[0].header.frame_id == "base_link"
    assert "in base_link" in capsys.readouterr().out


def test_a_timeout_cancels(
    navigation: FakeNavigation, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The robot does not drive on unobserved: its navigation is asked to cancel, and the time is the reason."""
    time = [0.0]
    monkeypatch.setattr(goto, "monotonic", lambda: time[0])
    run = Goto("1 3 4 --timeout 5", navigation)
    time[0] = 5.0
    assert run.end() == 1
    assert navigation.cancels == 1
    assert capsys.readouterr().err.endswith(": not reached within 5 s\n")


def test_a_timeout_without_navigation_says_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    """The way out is in the error."""
    assert Goto("1 3 4 --timeout 0.1").end() == 1
    why = "not reached within 0.1 s (waiting for the navigation of robot_1: start 'zteam-nav --id 1')"
    assert capsys.readouterr().err.endswith(f": {why}\n")


def test_ctrl_c_cancels(
    navigation: FakeNavigation, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl+C cancels the robot's goal; the exit code is that of an interrupt."""

    def interrupt(*_: object) -> bool:
        wait_for_goal(navigation)
        raise KeyboardInterrupt

    monkeypatch.setattr(goto.NavigationClient, "wait", interrupt)
    assert Goto("1 3 4").end() == 130
    assert navigation.cancels == 1
    assert capsys.readouterr().err.endswith(": x 3, y 4, yaw 0: interrupted\n")


def test_cancel(navigation: FakeNavigation, capsys: pytest.CaptureFixture[str]) -> None:
    """`--cancel` gives up whatever goal the robot has; without one it says so; without navigation it fails."""
    navigation.goals.append(PoseStamped())
    assert run_here("zteam goto --cancel 1") == 0
    navigation.goals.clear()
    assert run_here("zteam goto 1 --cancel --json") == 0
    assert run_here("zteam goto --cancel 2") == 1
    output = capsys.readouterr()
    assert output.out == 'robot_1: the goal is canceled\n{"robot":1,"canceled":false}\n'
    assert output.err == "zteam goto: robot_2 has no navigation: zteam-nav --id 2\n"


def test_a_robot_that_runs_go_to_gets_the_goal(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Without navigation the behaviour drives, and its status ends the command; the command says what drives."""
    robot = FakeNavigation(hub, 1, go_to=True)
    run = Goto("1 3 4 --json", robot)
    robot.say(State.SUCCEEDED)
    assert run.end() == 0
    output = capsys.readouterr()
    assert "robot_1 has no navigation: its behaviour go_to drives it, by its laser alone\n" in output.err
    assert '"driven_by":"go_to"' in output.out


@pytest.mark.gate
def test_a_robot_that_takes_no_goals_is_named(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """The user learns what the robot runs instead."""
    bus = hub.bus()
    bus.declare_token(names.token_key("robot_1", bus.instance))
    statuses = bus.publisher("robot_1/status", RobotStatus)
    run = Goto("1 3 4 --timeout 1")
    wait_until_true(lambda: bool(statuses.put(RobotStatus(robot_id=1, behavior="wander"))) or run.code is not None)
    assert run.end() == 1
    assert "zteam-nav --id 1'; it runs the behaviour wander, which takes no goals)" in capsys.readouterr().err
