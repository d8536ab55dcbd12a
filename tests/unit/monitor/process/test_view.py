"""A view of a monitor that runs already: on a bus in memory, beside the real monitor."""

import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from support.gate_feed import come
from support.limits import LIMIT
from support.log_capture import captured_log
from support.monitor_desk import Desk, Open, Robot
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.errors import UsageError
from zteam.messages import RobotState, TeamState, TeamStatus
from zteam.monitor.process import display
from zteam.monitor.process import node as module
from zteam.monitor.process.node import run_monitor
from zteam.monitor.process.start_gate import FollowedTeam
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions
from zteam.node.shutdown import Stop


class Second:
    """A second `zteam-monitor` in a thread, with its lines on standard output."""

    def __init__(self, hub: MemoryHub, options: MonitorOptions, capsys: pytest.CaptureFixture[str]) -> None:
        self.stop = Stop()
        self.node = ProcessNode(names.MONITOR, hub.bus(), self.stop)
        self._capsys = capsys
        self._shown = ""
        self._thread = threading.Thread(target=run_monitor, args=[self.node, options], daemon=True)
        self._thread.start()

    def wait_for(self, text: str) -> None:
        """Wait until it has printed that."""
        with self.node.changed:
            # It prints without the lock, so nothing notifies: look again from time to time.
            for _ in range(int(LIMIT / 0.05)):
                self._shown += self._capsys.readouterr().out
                if text in self._shown:
                    return
                wait_until(self.node.changed, lambda: False, 0.05)
        raise AssertionError(self._shown)

    def join(self) -> None:
        """Wait for its end."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive(), self._shown

    def close(self) -> None:
        """Stop it."""
        self.stop.request("test over")
        self.join()
        self.node.close()


@pytest.fixture
def first(open_desk: Open) -> Desk:
    """A monitor that runs and waits for robots 0 and 1."""
    desk = open_desk(0, 1)
    desk.node.become_present()
    desk.look()
    return desk


@pytest.fixture
def open_second(
    hub: MemoryHub, first: Desk, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., Second]]:
    """Starts further monitors."""
    monkeypatch.setattr(display, "_STATUSES", 0.0)
    made: list[Second] = []

    def start(**options: bool) -> Second:
        made.append(Second(hub, MonitorOptions(0, **options), capsys))
        return made[-1]

    yield start
    for second in made:
        second.close()


def test_it_shows_the_running_monitors_team(hub: MemoryHub, first: Desk, open_second: Callable[..., Second]) -> None:
    """It says that it is a view, prints the table, tells what the gate waits for, and GO; it gives none itself."""
    with captured_log() as log:
        second = open_second()
        log.wait_for("a monitor is running already (process ")
        second.wait_for("0 of 2 ready; waiting for robot_0: no process yet; robot_1: no process yet\n")
        second.wait_for("robot_1  absent")
        robots = [Robot(hub, 0), Robot(hub, 1)]
        robots[0].say()
        robots[1].say(RobotState.BOOT, text="waiting for its scan")
        first.look()
        second.wait_for("1 of 2 ready; waiting for robot_1: waiting for its scan\n")
        robots[1].say()
        first.look()
        second.wait_for("All robots GO!\n")
    assert first.told("go") == [("go", None)]
    assert [status.state for status in first.published].count(TeamState.GO) == 1
    assert hub.bus().query(names.stats_key(names.MONITOR), dict[str, object])[1:] == []


def test_exit_on_go_waits_for_the_running_monitors_go(
    hub: MemoryHub, first: Desk, open_second: Callable[..., Second]
) -> None:
    """It ends when GO is out and the robots run; at once if that is so already."""
    second = open_second(exit_on_go=True)
    second.wait_for("0 of 2 ready")
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
    first.look()
    second.wait_for("All robots GO!")
    for robot in robots:
        robot.say(RobotState.RUNNING, epoch=1)
    second.join()
    third = open_second(exit_on_go=True, json=True)
    third.wait_for('{"event":"status","robot":null,"text":"GO is out; 2 of 2 ready"}')
    first.pass_by(display.LEAVE_AFTER + 1)
    third.join()


def test_without_a_monitor_there_is_nothing_to_show(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error says how to be the monitor."""
    monkeypatch.setattr(module, "LOOK_FOR", 0.0)
    node = ProcessNode(names.MONITOR, hub.bus(), Stop())
    with pytest.raises(UsageError):
        run_monitor(node, MonitorOptions(0))
    node.close()


def test_go_and_its_epoch_are_the_running_monitors() -> None:
    """Robots that run give no GO, and another simulator no epoch: the status that comes has both."""
    team = FollowedTeam()
    # A monitor of an older version has no words for what it waits for.
    team.on_team(TeamStatus(team_size=2, missing=np.array([1, 4], np.int32)))
    come(team, 0, 1, state=RobotState.RUNNING, epoch=1)
    assert not team.gone
    for epoch, session in ((1, "one"), (2, "two")):
        team.on_team(TeamStatus(state=TeamState.GO, epoch=epoch, team_size=2, ready=np.array([0, 1], np.int32)))
        team.on_simulator(frozenset({session}))
        assert (team.epoch, team.all_running()) == (epoch, epoch == 1)
    assert [event.text for event in team.take_events()] == [
        "0 of 2 ready; waiting for robot_1: no process yet; robot_4: no process yet",
        "All robots GO!",
        "GO is out; 2 of 2 ready",
    ]
