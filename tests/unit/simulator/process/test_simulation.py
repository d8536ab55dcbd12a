"""A simulation: what a tick sends, the count of a run, changes of the world, status and report."""

from collections.abc import Callable, Iterator

import msgspec
import pytest

from support.lockstep_doubles import ScriptedMonitor
from support.simulator_parts import SimulatorParts
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import UsageError
from zteam.messages import BaseInfo, Bool, Clock, LaserScan, Odometry, TeamState, TFMessage, encode
from zteam.simulator.client import MoveRequest, SpawnRequest


@pytest.fixture
def parts(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator without a main loop."""
    made = SimulatorParts(hub)
    yield made
    made.close()


@pytest.fixture
def sent(hub: MemoryHub, parts: SimulatorParts) -> list[str]:
    """The topics that robot 0 and the clock publish, in order."""
    topics: list[str] = []
    for topic, kind in (
        (names.TF, TFMessage),
        (names.ODOM, Odometry),
        (names.BASE_SCAN, LaserScan),
        (names.STALL, Bool),
    ):
        hub.bus().subscribe(names.robot_key(0, topic), kind, lambda _key, _message, topic=topic: topics.append(topic))
    hub.bus().subscribe(names.CLOCK, Clock, lambda key, _: topics.append(key))
    return topics


def test_the_clock_comes_after_what_robots_need(parts: SimulatorParts, sent: list[str]) -> None:
    """Transforms first, then odometry and scan; the clock and the rest wake processes that can wait."""
    parts.whole_tick()
    sent.clear()
    parts.whole_tick()
    assert sent == [names.TF, names.ODOM, names.BASE_SCAN, names.CLOCK, names.STALL]


def test_the_first_tick_begins_with_the_clock(parts: SimulatorParts, sent: list[str]) -> None:
    """Processes that knew an earlier simulator see time jump back before the data; after a reset again."""
    parts.whole_tick()
    assert sent == [names.CLOCK, names.TF, names.ODOM, names.BASE_SCAN, names.STALL]
    parts.reset()
    sent.clear()
    parts.whole_tick()
    assert sent[0] == names.CLOCK


@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ((), [names.TF, names.ODOM, names.BASE_SCAN, names.STALL]),
        ((["robot_0"],), [names.TF, names.ODOM, names.BASE_SCAN]),
        ((["robot_1"],), []),
        ((["robot_1", "planner"],), [names.TF, names.ODOM, names.BASE_SCAN, names.STALL]),
    ],
)
def test_a_repeat_sends_the_last_tick_again(
    parts: SimulatorParts, sent: list[str], missing: tuple[list[str], ...], expected: list[str]
) -> None:
    """Without the clock: a robot that has not answered receives its inputs alone, another process everything, as its
    inputs are not known."""
    parts.whole_tick()
    sent.clear()
    parts.repeat(*missing)
    assert sent == expected


def test_the_scans_of_the_last_tick_can_be_asked_for(hub: MemoryHub, parts: SimulatorParts) -> None:
    """They are those that are sent, also without a subscriber; a robot that is not there has none."""
    assert parts.scans([0]).scans == []
    parts.whole_tick()
    assert [scan.key for scan in parts.scans([0, 7]).scans] == [names.scan_key(0, 0)]
    heard: list[LaserScan] = []
    hub.bus().subscribe(names.scan_key(0, 0), LaserScan, lambda _key, scan: heard.append(scan))
    parts.whole_tick()
    [asked] = parts.scans([0]).scans
    assert asked.content == encode(heard[-1])


@pytest.fixture
def half_second(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A run of half a second, without a main loop."""
    made = SimulatorParts(hub, run_for=0.5)
    yield made
    made.close()


def test_a_run_is_over_its_time_after_go(hub: MemoryHub, half_second: SimulatorParts) -> None:
    """GO in tick 2 of 0.1 s each: tick 7 is the last one. A stamp beyond this simulator's time belongs to an earlier
    simulator, and only the first GO counts."""
    half_second.whole_tick()
    half_second.whole_tick()
    monitor = ScriptedMonitor(hub)
    monitor.say(TeamState.WAITING)
    assert (half_second.since_go, half_second.statistics.go_stamp, half_second.statistics.ticks) == (None, None, 0)
    monitor.give_go(1, 10**15)
    assert [half_second.whole_tick() for _ in range(2)] == [False, False]
    monitor.give_go(1, half_second.engine.now)
    assert [half_second.whole_tick() for _ in range(3)] == [False, False, True]
    assert half_second.statistics.ticks == 5
    assert half_second.statistics.go_stamp == 2 * half_second.world.interval


def test_after_a_reset_go_holds_from_the_first_tick_on(half_second: SimulatorParts) -> None:
    """The count begins again with it."""
    for _ in range(3):
        half_second.whole_tick()
    half_second.set_go(half_second.engine.now)
    half_second.whole_tick()
    half_second.reset()
    assert half_second.statistics.go_stamp is None
    half_second.whole_tick()
    assert (half_second.statistics.go_stamp, half_second.statistics.ticks) == (half_second.world.interval, 1)


@pytest.fixture
def ticked(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator after its first tick, without a main loop."""
    made = SimulatorParts(hub)
    made.whole_tick()
    yield made
    made.close()


def test_robots_come_and_go(ticked: SimulatorParts) -> None:
    """A new robot gets the lowest free id, and its scans come with the next tick; one that leaves publishes no more,
    and a repeat does not send it either. A reset makes the first robots again."""
    scans = ticked.record(names.all_robots_key(names.BASE_SCAN), LaserScan)
    assert ticked.spawn(SpawnRequest(-3.5, -1.5)) == 3
    assert list(ticked.outputs) == [0, 1, 2, 3]
    ticked.whole_tick()
    assert scans == [names.scan_key(robot_id, 0) for robot_id in range(4)]
    ticked.remove(1)
    scans.clear()
    ticked.repeat()
    ticked.whole_tick()
    assert (list(ticked.outputs), scans.count(names.scan_key(1, 0)), len(scans)) == ([0, 2, 3], 0, 6)
    assert ticked.spawn(SpawnRequest(0.0, -3.0)) == 1
    ticked.reset()
    assert (ticked.engine.tick, sorted(ticked.outputs), ticked.statistics.go_stamp) == (0, [0, 1, 2], None)


def test_every_robot_tells_its_base_and_a_new_one_anew(ticked: SimulatorParts, hub: MemoryHub) -> None:
    """A late subscriber gets it; another robot of the same id tells its own, also when a reset makes it. A move tells
    the new origin of its `odom` frame alone."""
    told: list[str] = []
    hub.bus().subscribe(names.robot_key(1, names.BASE_INFO), BaseInfo, lambda _, m: told.append(m.model), latched=True)
    assert told == ["erratic"]
    small = msgspec.structs.replace(ticked.engine.robots[1], model="small")
    ticked.remove(1)
    ticked.engine.spawn(1, small)
    ticked.outputs.match_robots()
    assert told == ["erratic", "small"]
    ticked.reset()
    assert told == ["erratic", "small", "erratic"]
    frames = ticked.record(names.robot_key(1, names.TF_STATIC), TFMessage)
    ticked.move(MoveRequest(1, -3.5, -1.5))
    assert (told, frames) == (["erratic", "small", "erratic"], [names.robot_key(1, names.TF_STATIC)])


def test_a_refused_change_changes_nothing(ticked: SimulatorParts) -> None:
    """A robot or a model that is not there, an id that is taken, a place in a wall, in a robot or outside of the world.
    With force a robot stands there."""
    before = [ticked.engine.truth(robot_id) for robot_id in ticked.outputs]
    changes: list[Callable[[], object]] = [
        lambda: ticked.remove(9),
        lambda: ticked.move(MoveRequest(9, -3.5, -1.5)),
        lambda: ticked.spawn(SpawnRequest(-3.5, -1.5, id=1)),
        lambda: ticked.spawn(SpawnRequest(-3.5, -1.5, model="unicorn")),
    ]
    for x, y in ((-4.95, 0.0), before[1][:2], (40.0, 0.0)):
        changes.append(lambda x=x, y=y: ticked.move(MoveRequest(0, x, y)))  # type: ignore[misc]
        changes.append(lambda x=x, y=y: ticked.spawn(SpawnRequest(x, y)))  # type: ignore[misc]
    for change in changes:
        with pytest.raises(UsageError):
            change()
    assert list(ticked.outputs) == [0, 1, 2]
    assert [ticked.engine.truth(robot_id) for robot_id in ticked.outputs] == before
    assert ticked.spawn(SpawnRequest(-4.95, 3.0, force=True)) == 3
    ticked.move(MoveRequest(0, 0.0, -4.95, force=True))
    for _ in range(30):
        ticked.whole_tick()
    assert ticked.engine.truth(0)[:2] == pytest.approx((0.0, -4.95))
    assert ticked.engine.truth(3)[:2] == pytest.approx((-4.95, 3.0))


@pytest.fixture
def counted(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator after three ticks, the last of them after GO."""
    made = SimulatorParts(hub)
    made.whole_tick()
    made.whole_tick()
    made.set_go(made.engine.now)
    made.whole_tick()
    yield made
    made.close()


def test_the_report_takes_its_figures_from_the_parts(counted: SimulatorParts) -> None:
    """Statistics, profile and pacer; without lock-step nothing was repeated. A real-time factor needs two ticks."""
    report = counted.report()
    assert (report.wall_seconds, report.real_time_factor) == (0.0, None)
    counted.whole_tick()
    report = counted.report()
    assert (report.sim_seconds, report.ticks, report.finished) == (0.2, 2, False)
    assert report.trajectory_sha256 == counted.statistics.trajectory_sha256
    assert report.timing_ms == counted.profile.timing()
    assert report.real_time_factor == pytest.approx(0.1 / report.wall_seconds)
    assert (report.lockstep, report.resends, report.hung, report.lateness_p99_ms) == (False, 0, [], None)


def test_the_status_tells_the_session_and_the_world(counted: SimulatorParts) -> None:
    """The session id is what requests for changes carry."""
    counted.boundary.finish()
    status = counted.status()
    assert (status.instance, status.finished, status.lockstep) == (counted.node.bus.instance, True, False)
    assert (status.robots, status.tick, status.now) == ([0, 1, 2], 3, 3 * counted.world.interval)
