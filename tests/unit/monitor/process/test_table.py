"""The monitor's table and events as text and as JSON: what its rows say, at which width, live on a terminal too."""

import math
import sys
from collections.abc import Callable, Sequence

import msgspec
import pytest

from support.gate_feed import come
from support.limits import LIMIT
from support.monitor_desk import Open, Robot
from support.terminal import Screen
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import to_ns, wait_until
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.messages import Header, RobotDriver, RobotState, RobotStatus, time_from_ns
from zteam.monitor.observer import TeamObserver
from zteam.monitor.process import display
from zteam.monitor.process.display import JsonLines, Lines, LiveTable, Poses, Row, format_table, make_rows, team_notes
from zteam.monitor.process.start_gate import SILENT_AFTER, Event, Gate
from zteam.node.launcher import Restarted
from zteam.node.live_line import LiveLine
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.team.launch.progress import Progress
from zteam.transforms.client import Lookup, LookupReply, LookupRequest

POSE = Pose2(-12.345, 8.5, -3.1)
STOPPED = "stopped (zteam stop --release)"


def gate_of(*statuses: RobotStatus) -> Gate:
    """A gate whose robots' processes have these statuses since host time 10."""
    gate = Gate(range(len(statuses)), len(statuses))
    for robot_id, status in enumerate(statuses):
        gate.on_token(robot_id, True)
        gate.on_status(robot_id, msgspec.structs.replace(status, robot_id=robot_id), 10.0)
    return gate


def running(stamp: float = 0.0, **fields: object) -> RobotStatus:
    """The status of a robot that drives, at `stamp` seconds of the team's time."""
    status = RobotStatus(Header(time_from_ns(to_ns(stamp))), is_ready=True, state=RobotState.RUNNING, speed=0.2)
    return msgspec.structs.replace(status, **fields)


def reasons(gate: Gate, now: float = 10.0) -> list[str]:
    """Why each robot stands, by the table."""
    return [row.reason for row in make_rows(gate, {}, {}, now)]


def lines_of(rows: list[Row], notes: tuple[str, ...] = (), width: int = 80) -> list[str]:
    """The table's lines."""
    return [text for text, _ in format_table(rows, notes, width)]


def test_a_row_says_state_behaviour_pose_speed_age_and_reason() -> None:
    """Behaviour and leader, pose in `map`, speed of the newest command, age of the status, and why it stands; another
    driver is named."""
    wanders = running(behavior="wander", driver=RobotDriver.BEHAVIOR, speed=0.4)
    follows = running(behavior="follow", reason="obstacle ahead", leader=0, speed=0.0)
    led = running(behavior="wander", driver=RobotDriver.TELEOP)
    assert lines_of(make_rows(gate_of(wanders, follows, led), {0: POSE}, {}, 10.25), width=120) == [
        "robot    state    behaviour             x     y    yaw   m/s    age",
        "robot_0  running  wander           -12.35  8.50  -3.10  0.40  0.2 s",
        "robot_1  running  follow robot_0        -     -      -  0.00  0.2 s  obstacle ahead",
        "robot_2  running  teleop (wander)       -     -      -  0.20  0.2 s",
    ]


def test_a_robot_without_data_shows_no_speed() -> None:
    """Where a robot's time stands still its last speed is an old one; it shows again when time goes on, by its own
    statuses or by the simulator's ticks, as in lock-step, where a slow world repeats a status."""
    gate = gate_of(running(11.5))

    def rows(now: float) -> list[tuple[float | None, str]]:
        return [(row.speed, row.reason) for row in make_rows(gate, {}, {}, now)]

    assert rows(10.0 + SILENT_AFTER) == [(0.2, "")]
    gate.on_status(0, running(11.5), 14.0)
    assert rows(14.0) == [(None, "no data for 4 s")]
    gate.on_tick(115, 16.0)
    assert rows(16.0 + SILENT_AFTER) == [(0.2, "")]
    gate.on_tick(115, 20.0)
    assert rows(20.0) == [(None, "no data for 10 s")]
    gate.on_status(0, running(12.0), 20.5)
    assert rows(20.5) == [(0.2, "")]


def test_a_robot_that_is_stopped_says_so_in_each_state() -> None:
    """Its row has the way out, also before GO, and so has a line below; a process that is gone stops nothing."""
    ready = RobotStatus(is_ready=True, state=RobotState.READY, is_stopped=True)
    gate = gate_of(ready, running(is_stopped=True), running(is_stopped=True))
    gate.on_token(2, False)
    rows = make_rows(gate, {}, {}, 10.0)
    assert [(row.state, row.reason, row.is_stopped) for row in rows] == [
        ("ready", STOPPED, True), ("running", STOPPED, True), ("lost", "its process is gone", False),
    ]  # fmt: skip
    assert f"robots 0, 1: {STOPPED}" in team_notes(gate, {}, [])


def test_every_robot_has_a_state() -> None:
    """Robots without a process, lost, stopped, hung ones and those at fault, each with what is known of it."""
    gate = Gate(range(7), 7)
    come(gate, 0, 1, 2, 3)
    come(gate, 2, state=RobotState.STOPPED)
    for robot_id in (1, 2):
        gate.on_token(robot_id, False)
    gate.on_token(4, True)
    gate.check_silence(SILENT_AFTER + 1)
    come(gate, 3, now=5.0)
    come(gate, 6, state=RobotState.FAULT, now=5.0)
    gate.on_world([0, 1, 2, 3, 4, 6])
    rows = make_rows(gate, {}, {}, 5.0)
    assert [(row.state, row.reason) for row in rows] == [
        ("silent", "does not answer"),
        ("lost", "its process is gone"),
        ("stopped", "its process is gone"),
        ("ready", ""),
        ("absent", "no status yet"),
        ("absent", "not in the world; it has 0-4, 6 ('zteam sim spawn --id 5 --pose X Y YAW' adds it)"),
        ("fault", ""),
    ]
    assert [row.speed is None for row in rows] == [True, True, True, False, True, True, False]


def test_a_robot_that_was_taken_out_of_the_world_is_told_as_that() -> None:
    """Its own reason, such as a stale scan, follows from it; a robot with another source of scans stands for none."""
    gate = gate_of(running(reason="stale scan"), running())
    gate.on_world([])
    gone = "not in the world; it has no robot ('zteam sim spawn --id 0 --pose X Y YAW' adds it)"
    assert reasons(gate) == [gone, ""]


def test_no_line_is_wider_than_the_terminal() -> None:
    """At 80 columns a long reason is wrapped below its row, under the state, and a long behaviour is cut."""
    reason = "waiting for a first scan (robot_3/base_scan), odometry (robot_3/odom), its own pose in map"
    row = Row("robot_3", "boot", "follow robot_2", POSE, 0.0, 0.4, reason)
    wide = Row("robot_10", "running", "my_package.robots:TurnerOfTables", Pose2(-100.0, -100.0, -3.14), -0.55, 12.3)
    shown = lines_of([row], ("waiting for robot_3: " + reason,))
    assert shown[2:4] == [
        "         waiting for a first scan (robot_3/base_scan), odometry (robot_3/odom),",
        "         its own pose in map",
    ]
    assert " ".join(shown[4:]) == "waiting for robot_3: " + reason
    assert "my_package.robots:T…" in lines_of([wide])[1]
    assert max(map(len, [*shown, *lines_of([wide])])) <= 80


def test_the_notes_tell_of_go_and_of_what_is_wrong() -> None:
    """Before GO what it waits for, then that it is out; below it the processes that were started again, which the rows
    count for `--json`, and what else is wrong."""
    gate = Gate([0, 1], 2)
    restarts = {"robot_1": Restarted(2, 0.234), "planner": Restarted(1)}
    again = "started again: planner 1 time, robot_1 2 times (back after 0.2 s)"
    assert team_notes(gate, restarts, ["no sim"]) == ["waiting for robot_0, robot_1", again, "no sim"]
    assert [row.restarts for row in make_rows(gate, {}, restarts, 0.0)] == [0, 2]
    come(gate, 0, 1)
    gate.try_go(1)
    assert team_notes(gate, {}, []) == ["GO is out"]


def test_lines_for_users_and_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    """The same events and table as text, and as one JSON object a line."""
    events = [Event("ready", 1, 'ready ("x"\n)'), Event("go", None, "All robots GO!")]
    for output in (Lines(), JsonLines()):
        for event in events:
            output.show(event)
        output.print_table(make_rows(gate_of(running()), {0: POSE}, {}, 10.0), ["GO is out"])
    *text, ready, go, table = capsys.readouterr().out.splitlines()
    assert text[:2] == ['robot_1 ready ("x"\ufffd)', "All robots GO!"]
    assert (text[2][:5], text[-1]) == ("robot", "GO is out")
    assert [msgspec.json.decode(line) for line in (ready, go)] == [
        {"event": event.kind, "robot": event.robot, "text": event.text} for event in events
    ]
    row = msgspec.json.decode(table)
    assert (row["event"], row["text"], row["robots"][0]["state"]) == ("table", "GO is out", "running")


def draw(gate: Gate, *events: Event) -> None:
    """Print what a terminal shows: the events, and the table as it stands at the end."""
    with LiveLine(sys.stdout, keeps=True) as live:
        table = LiveTable(live)
        table.print_table(make_rows(gate, {}, {}, 1.0), ["waiting for robot_0"])
        for event in events:
            table.show(event)


def test_the_live_table_stands_below_the_events(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Events are printed above the table, in the exact words that users and scripts look for."""
    draw(gate_of(RobotStatus(text="waiting")), Event("lost", 3, "lost"), Event("go", None, "All robots GO!"))
    rows = Screen(80).feed(capsys.readouterr().out.replace("\n", "\r\n")).rows
    assert (rows[:2], rows[2][:5]) == (["robot_3 lost", "All robots GO!"], "robot")
    assert rows[-2:] == ["waiting for robot_0", ""]


@pytest.mark.parametrize("text", ["[/etc/passwd]", "[bold]x", "[link=http://x]", "\x1b[2J"])
def test_any_text_of_a_robot_is_shown_as_it_is(capsys: pytest.CaptureFixture[str], text: str) -> None:
    """A robot's text is neither markup nor a command to the terminal."""
    gate = gate_of(RobotStatus(state=RobotState.FAULT, text=text, reason=text))
    draw(gate, *gate.take_events())
    shown = capsys.readouterr().out
    assert "\x1b[2J" not in shown
    assert shown.count(text.replace("\x1b", "")) >= 2


class Drawings(Lines):
    """A live output that notes the states of robot 0 that it draws."""

    is_live = True

    def __init__(self) -> None:
        self.drawn: list[str] = []

    def print_table(self, rows: Sequence[Row], notes: Sequence[str]) -> None:
        """Draw."""
        self.drawn.append(rows[0].state)


def test_the_monitor_draws_the_table_again_and_again(
    hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without an option, and also where there is no event: a robot's new state is in the table."""
    monkeypatch.setattr(display, "_LIVE_PERIOD", 0.0)
    screen = Drawings()
    desk = open_desk(0, 1, output=screen)
    desk.look()
    assert screen.drawn[-1] == "absent"
    Robot(hub, 0).say(RobotState.BOOT)
    desk.look()
    assert screen.drawn[-1] == "boot"


def answer(lookup: Lookup) -> LookupReply:
    """Robot 2 is somewhere; the others are not known."""
    if lookup.source != "robot_2/base_footprint":
        return LookupReply(error="LookupException", text=f"{lookup.source} is not known")
    return LookupReply(1, (1.5, -2.0, 0.0), quaternion_from_yaw(0.5))


def test_poses_come_from_the_aggregator_and_restarts_from_the_launcher(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All robots are asked for in one query; one that is not known has no pose. Without the two there is nothing."""
    monkeypatch.setattr(display, "PERIOD", 0.01)
    node, launcher, counts = ProcessNode(names.MONITOR, hub.bus(), Stop()), hub.bus(), {"robot_1": 1}
    asked: list[list[str]] = []

    def serve(request: LookupRequest) -> list[LookupReply]:
        asked.append([f"{lookup.target} {lookup.source}" for lookup in request.lookups])
        return [*map(answer, request.lookups)]

    def wait_for(condition: Callable[[], bool]) -> None:
        # Nothing notifies.
        with node.changed:
            assert any(wait_until(node.changed, condition, 0.01) for _ in range(int(LIMIT / 0.01)))

    server = hub.bus().serve("tf/lookup", LookupRequest, serve)
    Progress(TeamObserver(launcher), lambda: 0.0, lambda: dict(counts))
    found = Poses(node, lambda: [1, 2])
    try:
        wait_for(lambda: bool(found.newest) and found.restarts == {"robot_1": Restarted(1)})
        assert found.newest.keys() == {2}
        assert math.isclose(found.newest[2].yaw, 0.5) and found.newest[2][:2] == (1.5, -2.0)
        assert asked[0] == ["map robot_1/base_footprint", "map robot_2/base_footprint"]
        counts["planner"] = 3
        wait_for(lambda: found.restarts == {"robot_1": Restarted(1), "planner": Restarted(3)})
        server.close()
        launcher.close()
        wait_for(lambda: not found.newest and not found.restarts)
    finally:
        node.stop.request("test over")
        node.close()
