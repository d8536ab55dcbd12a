"""The monitor on a bus in memory: what it publishes, when it gives GO, what it tells, how it ends."""

import logging
import threading

import msgspec
import pytest

from support.limits import LIMIT
from support.lockstep_doubles import show_simulator
from support.log_capture import captured_log
from support.monitor_desk import LOSS, Open, Robot
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wall_ns
from zteam.messages import (
    Clock,
    RobotState,
    RobotStatus,
    TeamState,
    TeamStatus,
    Tick,
    ns_from_time,
    time_from_ns,
)
from zteam.monitor.process import watch
from zteam.monitor.process.display import LEAVE_AFTER
from zteam.monitor.process.members import Event
from zteam.monitor.process.table import JsonLines, Lines
from zteam.node.logs import LogKeeper


def test_go_reaches_the_early_and_the_late(hub: MemoryHub, open_desk: Open) -> None:
    """GO carries the newest simulated time, and a subscriber that comes afterwards gets it too."""
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(1)))
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    robots[0].say()
    desk.event("ready", 0)
    assert desk.told("go") == []
    clock.put(Clock(time_from_ns(7_300_000_000)))
    robots[1].say()
    assert desk.event("go").text == "All robots GO!"
    desk.look()
    assert desk.published[-1].state == TeamState.GO
    late: list[TeamStatus] = []
    hub.bus().subscribe(names.TEAM_STATUS, TeamStatus, lambda _key, status: late.append(status), latched=True)
    for status in (desk.published[-1], late[-1]):
        assert (status.state, status.epoch, status.team_size) == (TeamState.GO, 1, 2)
        assert ns_from_time(status.go_stamp) == 7_300_000_000
        assert list(status.ready) == [0, 1]


def test_events_are_lines_of_the_log(hub: MemoryHub, open_desk: Open, capsys: pytest.CaptureFixture[str]) -> None:
    """What the monitor shows is in its log on the bus as well, trouble as a warning, and is not written to stderr."""
    kept: list[tuple[int, str]] = []
    keeper = LogKeeper()
    keeper.pass_to(lambda line: kept.append((line.level, line.text)))
    end = keeper.begin()
    with captured_log():
        desk = open_desk(0)
        robot = Robot(hub, 0)
        robot.say()
        desk.event("go")
        robot.say(RobotState.FAULT, text="no laser")
        desk.event("fault", 0)
    end()
    assert (logging.INFO, "All robots GO!") in kept
    assert (logging.WARNING, "robot_0 fault: no laser") in kept
    assert "All robots GO!" not in capsys.readouterr().err


def test_a_team_that_was_there_first_goes(hub: MemoryHub, open_desk: Open) -> None:
    """Tokens that are older than the monitor count; it only waits for statuses."""
    robots = [Robot(hub, 0), Robot(hub, 1)]
    desk = open_desk(team_size=2)
    for robot in robots:
        robot.say()
    desk.event("go")


def test_the_simulators_robots_are_waited_for(hub: MemoryHub, open_desk: Open) -> None:
    """If the simulator has as many robots as asked for, exactly those are waited for."""
    show_simulator(hub.bus(), robots=[3, 5])
    desk = open_desk(team_size=2)
    robots = {i: Robot(hub, i) for i in (0, 1, 3, 5)}
    for i in (0, 1, 3):
        robots[i].say()
    assert desk.event("ready", 3).text == "ready (1 of 2; waiting for robot_5)"
    desk.look()
    assert desk.told("go") == []
    robots[5].say()
    desk.event("go")


def test_of_some_ids_those_in_the_world_are_waited_for(hub: MemoryHub, open_desk: Open) -> None:
    """One team of containers works in worlds with fewer robots, and waits for all of them until the world is known."""
    desk = open_desk(0, 1, 2, 3, in_world=True)
    robots = {i: Robot(hub, i) for i in (0, 1, 7)}
    for i in (1, 7):
        robots[i].say()
    desk.look()
    show_simulator(hub.bus(), robots=[0, 1, 7])
    desk.look()
    assert desk.told("go") == []
    robots[0].say()
    desk.event("go")


def test_a_simulator_with_more_robots_names_none(hub: MemoryHub, open_desk: Open) -> None:
    """If the numbers differ, any robots count."""
    show_simulator(hub.bus(), robots=[3, 5, 8])
    desk = open_desk(team_size=2)
    desk.look()
    for i in (0, 8):
        Robot(hub, i).say()
    desk.event("go")


def test_the_team_status_is_published_on_change(hub: MemoryHub, open_desk: Open) -> None:
    """Heartbeats publish nothing; a robot that becomes ready or is lost does."""
    desk = open_desk(0, 1)
    robot = Robot(hub, 0)
    robot.say()
    desk.look()
    assert list(desk.published[-1].ready) == [0]
    desk.look()
    count = len(desk.published)
    for _ in range(3):
        robot.say()
        desk.look()
    assert len(desk.published) == count
    robot.vanish()
    desk.look()
    desk.pass_by(LOSS)
    desk.look()
    assert list(desk.published[-1].lost) == [0]
    assert list(desk.published[-1].missing) == [0, 1]
    assert len(desk.published) == count + 1


def test_a_wrong_key_is_counted_and_ignored(hub: MemoryHub, open_desk: Open) -> None:
    """A status under another robot's key, or bytes that are none, change the counters and nothing else."""
    desk = open_desk(0, 1)
    Robot(hub, 0).say()
    liar = hub.bus().publisher(names.robot_key(1, names.STATUS), RobotStatus)
    Robot(hub, 1)
    liar.put(RobotStatus(robot_id=0, is_ready=True, state=RobotState.READY))
    hub.bus().transport.declare_publisher(names.robot_key(1, names.STATUS), "", False).put(b"\x00\x01\x00\x00nonsense")
    desk.look()
    assert desk.node.bus.counters.snapshot()["robot_1/status"].dropped == 2
    assert desk.told("ready", "go") == [("ready", 0)]


def test_its_own_go_makes_no_robot_ready(hub: MemoryHub, open_desk: Open) -> None:
    """GO of another monitor neither makes a robot ready nor is it adopted."""
    desk = open_desk(0, 1)
    other = hub.bus().publisher(names.TEAM_STATUS, TeamStatus)
    Robot(hub, 0)
    Robot(hub, 1).say()
    other.put(TeamStatus(state=TeamState.GO, epoch=1, team_size=2))
    desk.look()
    assert desk.told("go", "adopted") == []
    assert desk.published[-1].state == TeamState.WAITING


def test_a_restarted_monitor_gives_the_same_go(hub: MemoryHub, open_desk: Open) -> None:
    """It adopts the epoch of the running robots and publishes GO for a robot that waits."""
    desk = open_desk(0, 1)
    Robot(hub, 0).say(RobotState.RUNNING, epoch=6)
    desk.event("adopted")
    desk.look()
    assert desk.published[-1].state == TeamState.GO
    assert desk.published[-1].epoch == 6
    Robot(hub, 1).say()
    desk.event("late", 1)
    assert desk.told("go") == []


def test_a_jump_back_renews_the_stamp(hub: MemoryHub, open_desk: Open) -> None:
    """A restarted simulator's team is released in its new time, with the same epoch."""
    clock = hub.bus().publisher(names.CLOCK, Clock)
    desk = open_desk(0)
    clock.put(Clock(time_from_ns(90_000_000_000)))
    Robot(hub, 0).say()
    desk.event("go")
    clock.put(Clock(time_from_ns(100_000_000)))
    desk.look()
    assert ns_from_time(desk.published[-1].go_stamp) == 100_000_000
    assert desk.published[-1].epoch == 1


def test_a_tick_that_no_simulator_sent_does_not_stop_its_time(hub: MemoryHub, open_desk: Open) -> None:
    """The monitor still follows the clock of a simulator in real time, and GO has its stamp."""
    show_simulator(hub.bus(), robots=[0])
    desk = open_desk(0)
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(1_000_000_000)))
    hub.bus().publisher(names.TICK, Tick).put(Tick())
    clock.put(Clock(time_from_ns(2_000_000_000)))
    Robot(hub, 0).say()
    desk.event("go")
    assert ns_from_time(desk.published[-1].go_stamp) == 2_000_000_000


def test_real_robots_go_in_wall_time(hub: MemoryHub, open_desk: Open) -> None:
    """Without a simulator GO holds from the host's time on."""
    before = wall_ns()
    desk = open_desk(0)
    Robot(hub, 0).say()
    desk.event("go")
    desk.look()
    assert desk.published[-1].state == TeamState.GO
    assert ns_from_time(desk.published[-1].go_stamp) >= before


def test_exit_on_go_waits_until_all_obey(hub: MemoryHub, open_desk: Open) -> None:
    """The latched GO dies with the monitor, so it leaves only when every robot runs."""
    desk = open_desk(0, 1, exit_on_go=True)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
    desk.event("go")
    robots[0].say(RobotState.RUNNING, epoch=1)
    desk.look()
    assert not desk.ended
    robots[1].say(RobotState.RUNNING, epoch=1)
    desk.look()
    assert desk.ended


def test_exit_on_go_has_an_end(hub: MemoryHub, open_desk: Open) -> None:
    """A robot that never obeys keeps the monitor for a few seconds only."""
    desk = open_desk(0, exit_on_go=True)
    Robot(hub, 0).say()
    desk.event("go")
    desk.look()
    assert not desk.ended
    desk.pass_by(LEAVE_AFTER + 1)
    assert desk.ended


def test_a_team_that_does_not_come_is_given_up(hub: MemoryHub, open_desk: Open) -> None:
    """After --go-timeout the monitor fails, and names each robot that is missing with the reason."""
    desk = open_desk(0, 1, 2, go_timeout=2.0)
    Robot(hub, 0).say()
    Robot(hub, 2).say(RobotState.BOOT, text="waiting for a first scan")
    desk.event("ready", 0)
    desk.pass_by(1.0)
    assert not desk.ended
    desk.pass_by(1.5)
    assert str(desk.failure) == (
        "no GO within 2 s: waiting for robot_1: no process yet; robot_2: waiting for a first scan"
    )


def test_after_go_there_is_no_time_out(hub: MemoryHub, open_desk: Open) -> None:
    """The time-out is one for GO: a team that drives is watched for ever, also when a robot is lost."""
    desk = open_desk(0, go_timeout=30.0)
    robot = Robot(hub, 0)
    robot.say()
    desk.event("go")
    robot.vanish()
    desk.pass_by(60.0)
    assert (desk.ended, desk.failure) == (False, None)


def test_a_stop_request_ends_it(open_desk: Open) -> None:
    """A monitor that waits for robots ends when it is asked to."""
    desk = open_desk(0, 1)
    desk.look()
    desk.stop.request("enough")
    desk.look()
    assert desk.ended


def test_the_bus_does_not_wait_for_the_terminal(hub: MemoryHub, open_desk: Open) -> None:
    """Events are shown without the node's lock: a blocked terminal must not hold up the bus, nor a table deadlock."""
    others: list[threading.Thread] = []
    changes: list[str] = []

    class Terminal(Lines):
        def show(self, event: Event) -> None:
            others.append(threading.Thread(target=change, args=[event.kind], daemon=True))
            others[-1].start()
            others[-1].join(LIMIT)

    def change(kind: str) -> None:
        with desk.node.changed:
            changes.append(kind)

    desk = open_desk(0, output=Terminal())
    for up in (False, True):
        desk.link.set_link(up)
        desk.look()
    Robot(hub, 0).say()
    desk.look()
    assert changes == ["link", "link", "ready", "go"]


def test_lines_for_users_and_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    """The same events as text, and as one JSON object a line."""
    events = [Event("ready", 1, 'ready (1 of 2; "x"\n)'), Event("go", None, "All robots GO!")]
    Lines().show(Event("lost", 3, "lost"))
    Lines().show(events[1])
    assert capsys.readouterr().out == "robot_3 lost\nAll robots GO!\n"
    for event in events:
        JsonLines().show(event)
    lines = capsys.readouterr().out.splitlines()
    assert [msgspec.json.decode(line) for line in lines] == [
        {"event": "ready", "robot": 1, "text": 'ready (1 of 2; "x"\n)'},
        {"event": "go", "robot": None, "text": "All robots GO!"},
    ]


def test_the_world_says_which_robots_it_lacks(hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    """An id that the simulator does not have is named in the published status, with the way out."""
    monkeypatch.setattr(watch, "LOOK", 0.0)
    show_simulator(hub.bus(), robots=[0, 1])
    desk = open_desk(0, 9)
    lacks = "robot_9: not in the world; it has 0, 1 ('zteam sim spawn --id 9 --pose X Y YAW' adds it)"
    desk.look()
    assert desk.published[-1].waiting_for == f"robot_0: no process yet; {lacks}"
