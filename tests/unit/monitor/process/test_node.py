"""The monitor on a bus in memory: what it publishes, when it gives GO, what it tells, how it ends."""

import logging
import threading

import pytest

from support.limits import LIMIT
from support.lockstep_doubles import show_simulator
from support.log_capture import captured_log
from support.monitor_desk import LOSS, Open, Robot
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wall_ns
from zteam.messages import Clock, RobotState, RobotStatus, TeamState, TeamStatus, Tick, ns_from_time, time_from_ns
from zteam.monitor.process import watch
from zteam.monitor.process.display import LEAVE_AFTER, Lines
from zteam.monitor.process.start_gate import Event
from zteam.node.logs import LogKeeper

S = 10**9


def test_go_reaches_the_early_and_the_late(hub: MemoryHub, open_desk: Open) -> None:
    """GO carries the newest simulated time, also after a tick that no simulator sent; a subscriber that comes
    afterwards gets it too. Where time jumps back it holds from the new time on."""
    show_simulator(hub.bus(), lockstep=False, robots=[0, 1])
    robots, clock = [Robot(hub, 0), Robot(hub, 1)], hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(1)))
    desk = open_desk(0, 1)
    robots[0].say()
    desk.event("ready", 0)
    hub.bus().publisher(names.TICK, Tick).put(Tick())
    clock.put(Clock(time_from_ns(7 * S)))
    robots[1].say()
    assert desk.event("go").text == "All robots GO!"
    desk.look()
    late: list[TeamStatus] = []
    hub.bus().subscribe(names.TEAM_STATUS, TeamStatus, lambda _key, status: late.append(status), latched=True)
    for status in (desk.published[-1], late[-1]):
        assert (status.state, status.epoch, status.team_size) == (TeamState.GO, 1, 2)
        assert (ns_from_time(status.go_stamp), list(status.ready)) == (7 * S, [0, 1])
    clock.put(Clock(time_from_ns(S)))
    desk.look()
    assert (ns_from_time(desk.published[-1].go_stamp), desk.published[-1].epoch) == (S, 1)


def test_real_robots_go_in_wall_time(hub: MemoryHub, open_desk: Open) -> None:
    """Without a simulator GO holds from the host's time on."""
    before, desk = wall_ns(), open_desk(0)
    Robot(hub, 0).say()
    desk.event("go")
    desk.look()
    assert ns_from_time(desk.published[-1].go_stamp) >= before


@pytest.mark.parametrize(
    ("ids", "team_size", "in_world", "world", "some", "rest"),
    [
        ((), 2, False, [3, 5], [0, 1, 3], [5]),
        ((), 2, False, [3, 5, 8], [0], [8]),
        ((0, 1, 2, 3), 0, True, [0, 1, 7], [1, 7], [0]),
    ],
    ids=["as many as asked for", "another number", "of some ids those in the world"],
)
def test_the_simulators_robots_are_waited_for(
    hub: MemoryHub,
    open_desk: Open,
    ids: tuple[int, ...],
    team_size: int,
    in_world: bool,
    world: list[int],
    some: list[int],
    rest: list[int],
) -> None:
    """Exactly those if the numbers agree, else any; one team of containers works in worlds with fewer robots, and waits
    for all of them until the world is known."""
    robots = {i: Robot(hub, i) for i in (*some, *rest)}
    desk = open_desk(*ids, team_size=team_size, in_world=in_world)
    desk.look()
    show_simulator(hub.bus(), robots=world)
    desk.look()
    for i in some:
        robots[i].say()
    assert desk.told("go") == []
    for i in rest:
        robots[i].say()
    desk.event("go")


def test_the_team_status_is_published_on_change(hub: MemoryHub, open_desk: Open) -> None:
    """Heartbeats publish nothing; a robot that becomes ready or is lost does. GO of another monitor changes nothing."""
    desk, robot = open_desk(0, 1), Robot(hub, 0)
    Robot(hub, 1)
    robot.say()
    desk.look()
    hub.bus().publisher(names.TEAM_STATUS, TeamStatus).put(TeamStatus(state=TeamState.GO, epoch=1, team_size=2))
    assert (desk.told("go", "adopted"), list(desk.published[-2].ready)) == ([], [0])
    count = len(desk.published)
    for _ in range(3):
        robot.say()
        desk.look()
    assert len(desk.published) == count
    robot.vanish()
    desk.look()
    desk.pass_by(LOSS)
    desk.look()
    assert (list(desk.published[-1].lost), list(desk.published[-1].missing)) == ([0], [0, 1])
    assert len(desk.published) == count + 1


def test_a_wrong_key_is_counted_and_ignored(hub: MemoryHub, open_desk: Open) -> None:
    """A status under another robot's key, also before that robot's process, or bytes that are none, change the counters
    and nothing else."""
    desk = open_desk(team_size=2)
    Robot(hub, 0).say()
    liar = hub.bus().publisher(names.robot_key(1, names.STATUS), RobotStatus)
    lie = RobotStatus(robot_id=0, is_ready=True, state=RobotState.READY)
    liar.put(lie)
    Robot(hub, 1)
    liar.put(lie)
    hub.bus().transport.declare_publisher(names.robot_key(1, names.STATUS), "", False).put(b"\x00\x01\x00\x00nonsense")
    desk.look()
    assert desk.node.bus.counters.snapshot()["robot_1/status"].dropped == 4
    assert desk.told("ready", "go") == [("ready", 0)]


def test_the_world_says_which_robots_it_lacks(hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    """An id that the simulator does not have is named in the published status, with the way out."""
    monkeypatch.setattr(watch, "LOOK", 0.0)
    show_simulator(hub.bus(), robots=[0, 1])
    desk = open_desk(0, 9)
    lacks = "robot_9: not in the world; it has 0, 1 ('zteam sim spawn --id 9 --pose X Y YAW' adds it)"
    desk.look()
    assert desk.published[-1].waiting_for == f"robot_0: no process yet; {lacks}"


def test_events_are_lines_of_the_log(hub: MemoryHub, open_desk: Open, capsys: pytest.CaptureFixture[str]) -> None:
    """What the monitor shows is in its log on the bus as well, trouble as a warning, and is not written to stderr."""
    kept: list[tuple[int, str]] = []
    keeper = LogKeeper()
    keeper.pass_to(lambda line: kept.append((line.level, line.text)))
    end = keeper.begin()
    with captured_log():
        desk, robot = open_desk(0), Robot(hub, 0)
        robot.say()
        desk.event("go")
        robot.say(RobotState.FAULT, text="no laser")
        desk.event("fault", 0)
    end()
    assert (logging.INFO, "All robots GO!") in kept
    assert (logging.WARNING, "robot_0 fault: no laser") in kept
    assert "All robots GO!" not in capsys.readouterr().err


@pytest.mark.parametrize("obeys", [True, False])
def test_exit_on_go_waits_until_all_obey(hub: MemoryHub, open_desk: Open, obeys: bool) -> None:
    """The latched GO dies with the monitor, so it leaves only when every robot runs, or after a few seconds."""
    desk, robots = open_desk(0, 1, exit_on_go=True), [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
    desk.event("go")
    robots[0].say(RobotState.RUNNING, epoch=1)
    desk.look()
    assert not desk.ended
    if obeys:
        robots[1].say(RobotState.RUNNING, epoch=1)
        desk.look()
    else:
        desk.pass_by(LEAVE_AFTER + 1)
    assert desk.ended


def test_a_team_that_does_not_come_is_given_up(hub: MemoryHub, open_desk: Open) -> None:
    """After --go-timeout the monitor fails, and names each robot that is missing with the reason; after GO a team is
    watched for ever, until it is asked to stop."""
    desk, complete = open_desk(0, 1, 2, go_timeout=2.0), open_desk(0, go_timeout=2.0)
    Robot(hub, 0).say()
    Robot(hub, 2).say(RobotState.BOOT, text="waiting for a first scan")
    desk.event("ready", 0)
    complete.event("go")
    desk.pass_by(1.0)
    assert not desk.ended
    desk.pass_by(1.5)
    assert str(desk.failure) == (
        "no GO within 2 s: waiting for robot_1: no process yet; robot_2: waiting for a first scan"
    )
    complete.pass_by(60.0)
    assert (complete.ended, complete.failure) == (False, None)
    complete.stop.request("enough")
    complete.look()
    assert complete.ended


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


def test_robots_without_a_process_are_no_members(hub: MemoryHub, open_desk: Open) -> None:
    """Any number of statuses may be invented; a robot whose token comes after its status counts all the same."""
    desk = open_desk(team_size=1)
    desk.look()
    late = Robot(hub, 7, present=False)
    late.say()
    for number in range(100, 300):
        Robot(hub, number, present=False).say(RobotState.FAULT)
    desk.look()
    late.appear()
    assert desk.told("go", "fault") == [("go", None)]
    assert [*desk.monitor.gate.members] == [7]
