"""The monitor on a bus in memory: what it publishes, what it tells, how it takes losses of every kind."""

import threading
from collections.abc import Callable, Iterator

import msgspec
import pytest

from support.cuttable_transport import cut_bus
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.cli.zteam_monitor import parse_team
from zteam.clock import wait_until, wall_ns
from zteam.errors import UsageError
from zteam.messages import Clock, RobotState, RobotStatus, TeamState, TeamStatus, Tick, ns_from_time, time_from_ns
from zteam.nodes.monitor import node as monitor_module
from zteam.nodes.monitor.members import SILENT_AFTER, Event
from zteam.nodes.monitor.node import LEAVE_AFTER, Monitor, MonitorOptions, print_event, print_json
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import SimStatus

LIMIT = 20.0
"""Host seconds after which a wait has failed."""
FLICKER, LOSS, RETURN = 0.1, 1.0, 10.0
"""Host seconds: of a token that is back at once; after which a loss is told; after which everybody found the router."""
SCOUT = 99
"""A robot of no team, whose faults mark how far the monitor has come."""


class HostTime:
    """The monitor's host clock, set by the test."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Robot:
    """A robot process as the monitor sees it."""

    def __init__(self, hub: MemoryHub, robot_id: int, *, present: bool = True) -> None:
        self.id = robot_id
        self._bus = hub.bus()
        self._status = self._bus.publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
        if present:
            self.appear()

    def appear(self) -> None:
        """Hold the name (again)."""
        self._token = self._bus.declare_token(names.token_key(names.robot_name(self.id), self._bus.instance))

    def vanish(self) -> None:
        """The token goes."""
        self._token.close()

    def say(self, state: int = RobotState.READY, epoch: int = 0, text: str = "") -> None:
        """Publish a status."""
        ready = state in (RobotState.READY, RobotState.RUNNING)
        self._status.put(RobotStatus(robot_id=self.id, is_ready=ready, state=state, epoch=epoch, text=text))


class Desk:
    """A running monitor, and what it shows and publishes."""

    def __init__(self, hub: MemoryHub, time: HostTime, options: MonitorOptions) -> None:
        self.hub = hub
        self.time = time
        self.changed = threading.Condition(threading.RLock())
        self.events: list[Event] = []
        self.published: list[TeamStatus] = []
        self.free: list[bool] = []
        """Whether nobody was kept waiting while an event was shown, for each event."""
        bus, self.link = cut_bus(hub)
        self.stop = Stop()
        self.node = Node(names.MONITOR, bus, self.stop)
        hub.bus().subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status)
        self.monitor = Monitor(self.node, options, self._show)
        self.thread = threading.Thread(target=self.monitor.run)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        with self.changed:
            self.published.append(status)
            self.changed.notify_all()

    def _show(self, event: Event) -> None:
        probe = threading.Thread(target=self._try_lock)
        probe.start()
        probe.join()
        with self.changed:
            self.events.append(event)
            self.changed.notify_all()

    def _try_lock(self) -> None:
        free = self.node.changed.acquire(blocking=False)
        if free:
            self.node.changed.release()
        self.free.append(free)

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait until something shown or published makes it true."""
        with self.changed:
            assert wait_until(self.changed, condition, LIMIT), (self.events, self.published[-1:])

    def wait_for(self, kind: str, robot: int | None = None) -> Event:
        """Wait for an event of this kind about this robot."""
        self.wait(lambda: any((e.kind, e.robot) == (kind, robot) for e in self.events))
        return next(e for e in self.events if (e.kind, e.robot) == (kind, robot))

    def pass_by(self, seconds: float) -> None:
        """Let host time pass, and the monitor look at what that means."""
        self.time.now += seconds
        self.look()

    def look(self) -> None:
        """Return when the monitor has looked at, and told, everything that happened until now."""
        # A robot outside of the team breaks down twice. What the monitor tells in the round of the first time may
        # come after it; the second time is told in a later round.
        for _ in range(2):
            with self.changed:
                seen = self.told("fault").count(("fault", SCOUT))
            scout = Robot(self.hub, SCOUT, present=False)
            scout.say(RobotState.BOOT)
            scout.say(RobotState.FAULT)
            self.wait(lambda before=seen: self.told("fault").count(("fault", SCOUT)) > before)  # type: ignore[misc]

    def told(self, *kinds: str) -> list[tuple[str, int | None]]:
        """(kind, robot) of the events of these kinds so far."""
        with self.changed:
            return [(e.kind, e.robot) for e in self.events if e.kind in kinds]

    def end(self) -> None:
        """Stop the monitor and wait for it."""
        self.stop.request("test over")
        if self.thread.ident is not None:
            self.thread.join(LIMIT)
        self.node.close()
        assert not self.thread.is_alive()


Open = Callable[..., Desk]


@pytest.fixture
def open_desk(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Iterator[Open]:
    """Starts monitors that wait for `ids` or `team_size` robots."""
    time, desks = HostTime(), []
    monkeypatch.setattr(monitor_module, "monotonic", time)

    def make(*ids: int, team_size: int = 0, run: bool = True, exit_on_go: bool = False) -> Desk:
        options = MonitorOptions(team_size or len(ids), ids or None, exit_on_go=exit_on_go)
        desk = Desk(hub, time, options)
        desks.append(desk)
        if run:
            desk.thread.start()
        return desk

    yield make
    for desk in desks:
        desk.end()


def serve_simulator(hub: MemoryHub, robots: list[int]) -> None:
    """A simulator with these robots appears."""
    bus = hub.bus()
    answer = SimStatus("w", robots, 100, 1, 0, 0, 1.0)
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: answer)
    bus.declare_token(names.token_key(names.SIMULATOR, bus.instance))


def test_go_reaches_the_early_and_the_late(hub: MemoryHub, open_desk: Open) -> None:
    """GO carries the newest simulated time, and a subscriber that comes afterwards gets it too."""
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(1)))
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    robots[0].say()
    desk.wait_for("ready", 0)
    assert desk.told("go") == []
    clock.put(Clock(time_from_ns(7_300_000_000)))
    robots[1].say()
    assert desk.wait_for("go").text == "All robots GO!"
    desk.wait(lambda: bool(desk.published) and desk.published[-1].state == TeamState.GO)
    late: list[TeamStatus] = []
    hub.bus().subscribe(names.TEAM_STATUS, TeamStatus, lambda _key, status: late.append(status), latched=True)
    for status in (desk.published[-1], late[-1]):
        assert (status.state, status.epoch, status.team_size) == (TeamState.GO, 1, 2)
        assert ns_from_time(status.go_stamp) == 7_300_000_000
        assert list(status.ready) == [0, 1]


def test_a_team_that_was_there_first_goes(hub: MemoryHub, open_desk: Open) -> None:
    """Tokens that are older than the monitor count; a status is all it waits for."""
    robots = [Robot(hub, 0), Robot(hub, 1)]
    desk = open_desk(team_size=2)
    for robot in robots:
        robot.say()
    desk.wait_for("go")


def test_the_simulators_robots_are_waited_for(hub: MemoryHub, open_desk: Open) -> None:
    """With as many robots as asked for, the simulator says which ones they are."""
    serve_simulator(hub, [3, 5])
    desk = open_desk(team_size=2)
    robots = {i: Robot(hub, i) for i in (0, 1, 3, 5)}
    for i in (0, 1, 3):
        robots[i].say()
    assert desk.wait_for("ready", 3).text == "ready (1 of 2; waiting for robot_5)"
    desk.look()
    assert desk.told("go") == []
    robots[5].say()
    desk.wait_for("go")


def test_a_simulator_with_more_robots_names_nobody(hub: MemoryHub, open_desk: Open) -> None:
    """Where the numbers differ, the monitor can only count."""
    serve_simulator(hub, [3, 5, 8])
    desk = open_desk(team_size=2)
    desk.look()
    for i in (0, 8):
        Robot(hub, i).say()
    desk.wait_for("go")


def test_the_team_status_is_published_on_change(hub: MemoryHub, open_desk: Open) -> None:
    """Heartbeats publish nothing; a robot that becomes ready or is lost does."""
    desk = open_desk(0, 1)
    robot = Robot(hub, 0)
    robot.say()
    desk.wait(lambda: bool(desk.published) and list(desk.published[-1].ready) == [0])
    desk.look()
    count = len(desk.published)
    for _ in range(3):
        robot.say()
        desk.look()
    assert len(desk.published) == count
    robot.vanish()
    desk.look()
    desk.pass_by(LOSS)
    desk.wait(lambda: list(desk.published[-1].lost) == [0])
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


def test_its_own_go_makes_nobody_ready(hub: MemoryHub, open_desk: Open) -> None:
    """What the monitor itself publishes is no robot's word, and two monitors' GOs neither."""
    desk = open_desk(0, 1)
    other = hub.bus().publisher(names.TEAM_STATUS, TeamStatus)
    Robot(hub, 0)
    Robot(hub, 1).say()
    other.put(TeamStatus(state=TeamState.GO, epoch=1, team_size=2))
    desk.look()
    assert desk.told("go", "adopted") == []
    assert desk.published[-1].state == TeamState.WAITING


def test_a_token_that_only_flickers_is_no_loss(hub: MemoryHub, open_desk: Open) -> None:
    """A token that is back within the grace was never gone; one that stays away is lost."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.pass_by(FLICKER)
    robots[0].appear()
    desk.pass_by(LOSS)
    assert desk.told("lost", "back") == [("lost", 1)]


def test_a_lost_router_is_no_lost_team(hub: MemoryHub, open_desk: Open) -> None:
    """Tokens that vanish just before the link are told as one lost router, and come back without a word."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.link.set_link(False)
    desk.pass_by(RETURN)
    desk.link.set_link(True)
    for robot in robots:
        robot.appear()
    desk.pass_by(RETURN)
    assert [e.text for e in desk.events if e.kind == "link"] == ["router lost", "router is back"]
    assert desk.told("lost", "back") == []


def test_no_go_without_a_router(hub: MemoryHub, open_desk: Open) -> None:
    """Nobody would hear it; it is given when the router is back."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    desk.link.set_link(False)
    robot.say()
    desk.look()
    assert desk.told("go") == []
    desk.link.set_link(True)
    desk.wait_for("go")


def test_tokens_may_vanish_after_the_link(hub: MemoryHub, open_desk: Open) -> None:
    """Which of both is told first is chance; robots get some time to come back in either case."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    robot.say()
    desk.link.set_link(False)
    robot.vanish()
    desk.pass_by(5.0)
    desk.link.set_link(True)
    desk.look()
    robot.appear()
    desk.pass_by(RETURN)
    assert desk.told("lost", "back") == []


def test_who_died_while_the_router_was_away_is_lost(hub: MemoryHub, open_desk: Open) -> None:
    """After the router is back, a robot whose token stays away is told as lost."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.link.set_link(False)
    desk.pass_by(5.0)
    desk.link.set_link(True)
    robots[0].appear()
    for _ in range(20):
        desk.pass_by(1.0)
    assert desk.told("lost", "back") == [("lost", 1)]


def test_nobody_is_silent_without_a_router(hub: MemoryHub, open_desk: Open) -> None:
    """While the router is away the robots are not said to be silent, nor at once when it is back."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    robot.say()
    desk.link.set_link(False)
    desk.pass_by(SILENT_AFTER * 2)
    desk.link.set_link(True)
    desk.look()
    desk.pass_by(SILENT_AFTER * 0.9)
    assert desk.told("silent") == []
    desk.pass_by(SILENT_AFTER)
    assert desk.told("silent") == [("silent", 0)]


def test_a_hung_robot_is_named(hub: MemoryHub, open_desk: Open) -> None:
    """A living token without statuses is told as not answering, and never as lost."""
    desk = open_desk(0, 1)
    robot = Robot(hub, 0)
    robot.say()
    desk.pass_by(SILENT_AFTER + 1)
    assert desk.wait_for("silent", 0).text == "does not answer for 4 s"
    robot.say()
    desk.wait_for("answers", 0)
    assert desk.told("lost") == []


def test_a_restarted_monitor_gives_the_same_go(hub: MemoryHub, open_desk: Open) -> None:
    """It adopts the epoch that running robots tell and publishes GO for a robot that waits."""
    desk = open_desk(0, 1)
    Robot(hub, 0).say(RobotState.RUNNING, epoch=6)
    desk.wait_for("adopted")
    desk.wait(lambda: bool(desk.published) and desk.published[-1].state == TeamState.GO)
    assert desk.published[-1].epoch == 6
    Robot(hub, 1).say()
    desk.wait_for("late", 1)
    assert desk.told("go") == []


def test_a_jump_back_renews_the_stamp(hub: MemoryHub, open_desk: Open) -> None:
    """A restarted simulator's team is released in its new time, with the same epoch."""
    clock = hub.bus().publisher(names.CLOCK, Clock)
    desk = open_desk(0)
    clock.put(Clock(time_from_ns(90_000_000_000)))
    Robot(hub, 0).say()
    desk.wait_for("go")
    clock.put(Clock(time_from_ns(100_000_000)))
    desk.wait(lambda: ns_from_time(desk.published[-1].go_stamp) == 100_000_000)
    assert desk.published[-1].epoch == 1


def test_a_tick_that_no_simulator_sent_does_not_stop_its_time(hub: MemoryHub, open_desk: Open) -> None:
    """The clock of a simulator in real time goes on to be heard, and GO has its stamp."""
    serve_simulator(hub, [0])
    desk = open_desk(0)
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(1_000_000_000)))
    hub.bus().publisher(names.TICK, Tick).put(Tick())
    clock.put(Clock(time_from_ns(2_000_000_000)))
    Robot(hub, 0).say()
    desk.wait_for("go")
    assert ns_from_time(desk.published[-1].go_stamp) == 2_000_000_000


def test_real_robots_go_in_wall_time(hub: MemoryHub, open_desk: Open) -> None:
    """Without a simulator GO holds from the host's time on."""
    before = wall_ns()
    desk = open_desk(0)
    Robot(hub, 0).say()
    desk.wait_for("go")
    desk.wait(lambda: bool(desk.published) and desk.published[-1].state == TeamState.GO)
    assert ns_from_time(desk.published[-1].go_stamp) >= before


def test_exit_on_go_waits_until_all_obey(hub: MemoryHub, open_desk: Open) -> None:
    """The latched GO dies with the monitor, so it leaves only when every robot runs."""
    desk = open_desk(0, 1, exit_on_go=True)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
    desk.wait_for("go")
    robots[0].say(RobotState.RUNNING, epoch=1)
    desk.look()
    assert desk.thread.is_alive()
    robots[1].say(RobotState.RUNNING, epoch=1)
    desk.thread.join(LIMIT)
    assert not desk.thread.is_alive()


def test_exit_on_go_has_an_end(hub: MemoryHub, open_desk: Open) -> None:
    """A robot that never obeys keeps the monitor for a few seconds only."""
    desk = open_desk(0, exit_on_go=True)
    Robot(hub, 0).say()
    desk.wait_for("go")
    desk.look()
    assert desk.thread.is_alive()
    desk.time.now += LEAVE_AFTER + 1
    desk.thread.join(LIMIT)
    assert not desk.thread.is_alive()


def test_a_stop_request_ends_it(open_desk: Open) -> None:
    """A monitor that waits for robots ends when it is asked to."""
    desk = open_desk(0, 1)
    desk.look()
    desk.stop.request("enough")
    desk.thread.join(LIMIT)
    assert not desk.thread.is_alive()


def test_nobody_waits_for_the_terminal(hub: MemoryHub, open_desk: Open) -> None:
    """Events are shown without the node's lock: a blocked terminal must not hold up the bus, nor a table deadlock."""
    desk = open_desk(0)
    for up in (False, True):
        before = len(desk.told("link"))
        desk.link.set_link(up)
        desk.wait(lambda told=before: len(desk.told("link")) > told)  # type: ignore[misc]
    Robot(hub, 0).say()
    desk.wait_for("go")
    assert all(desk.free), list(zip(desk.events, desk.free, strict=True))


def test_lines_for_people_and_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    """The same events as text, and as one JSON object a line."""
    events = [Event("ready", 1, 'ready (1 of 2; "x"\n)'), Event("go", None, "All robots GO!")]
    print_event(Event("lost", 3, "lost"))
    print_event(events[1])
    assert capsys.readouterr().out == "robot_3 lost\nAll robots GO!\n"
    for event in events:
        print_json(event)
    lines = capsys.readouterr().out.splitlines()
    assert [msgspec.json.decode(line) for line in lines] == [
        {"event": "ready", "robot": 1, "text": 'ready (1 of 2; "x"\n)'},
        {"event": "go", "robot": None, "text": "All robots GO!"},
    ]


@pytest.mark.parametrize(
    ("size", "ids", "team"),
    [
        ("4", None, (4, None)),
        (None, ["0", "2", "7"], (3, (0, 2, 7))),
        ("2", ["5", "0"], (2, (5, 0))),
        ("1", None, (1, None)),
        ("10000", None, (10000, None)),
    ],
)
def test_team_sizes(size: str | None, ids: list[str] | None, team: tuple[int, tuple[int, ...] | None]) -> None:
    """A number, a list, or both if they agree."""
    assert parse_team(size, ids) == team


@pytest.mark.parametrize(
    ("size", "ids", "text"),
    [
        (None, None, "--team-size 4"),
        ("3", ["0", "1"], "disagree"),
        (None, ["0", "1", "0"], "twice"),
        (None, ["0", "00"], "twice"),
        *[(size, None, f"--team-size {size}") for size in ("0", "-1", "4x", "", "²", "1.0", "10001", "9" * 40, " 4")],
        *[(None, [robot_id], repr(robot_id)) for robot_id in ("abc", "1x", "-1", "10000", "", "٣", "1 ")],
    ],
)
def test_bad_teams_are_refused(size: str | None, ids: list[str] | None, text: str) -> None:
    """Nonsense ends with exit code 2 and one line that names it."""
    with pytest.raises(UsageError) as caught:
        parse_team(size, ids)
    assert text in str(caught.value)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)
