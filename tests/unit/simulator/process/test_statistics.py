"""The count of a run since GO, and what a tick spends its time on."""

import hashlib
import struct
from collections.abc import Collection, Mapping

import numpy as np
import pytest

from zteam.geometry import Pose2, normalize_angle
from zteam.simulator.client import Gap, Latency, Timing
from zteam.simulator.process import statistics as module
from zteam.simulator.process.statistics import Phase, RunStatistics, TickProfile

START = {0: Pose2(0.0, 0.0, 0.0), 1: Pose2(0.0, 2.0, 0.0)}


def started(tick: int = 10) -> RunStatistics:
    """A run of two robots, of which 1 follows 0, since `tick`."""
    statistics = RunStatistics({1: 0})
    statistics.start(tick * 100, tick, START, np.array(list(START.values())))
    return statistics


def add(
    statistics: RunStatistics, poses: Mapping[int, Pose2], stalled: Collection[int] = (), scans: Mapping[int, int] = {}
) -> None:
    """A tick of robots by id."""
    ids = sorted(poses)
    statistics.add_tick(ids, np.array([poses[i] for i in ids]), np.array([i in stalled for i in ids]), scans)


def test_nothing_counts_before_go() -> None:
    """Late steps, latencies and foreign commands of the time before are ignored."""
    statistics = RunStatistics({})
    statistics.add_late_steps(50, [0])
    statistics.add_latency(0.1)
    statistics.add_external_command()
    assert (statistics.robots(), statistics.external_commands) == ([], 0)
    assert statistics.latency() == Latency(None, None, 0)


def test_distance_is_the_length_of_the_path() -> None:
    """It sums the moves between ticks, not the way from start to end, as it sums scans. The first pose of a robot that
    comes later is no move."""
    statistics = started()
    for x in (3.0, 0.0):
        add(statistics, {0: Pose2(x, 0.0, 0.0), 1: START[1], 5: Pose2(7.0, 7.0, 0.0)}, scans={0: 2})
    assert [(robot.id, robot.distance_m, robot.scans) for robot in statistics.robots()] == [
        (0, 6.0, 4), (1, 0.0, 0), (5, 0.0, 0),
    ]  # fmt: skip


def test_to_be_set_down_is_no_path() -> None:
    """A robot that was moved, or removed and put back elsewhere, has driven only what it drove from there."""
    statistics = started()
    statistics.set_down(0, Pose2(5.0, 5.0, 0.0))
    statistics.set_down(7, Pose2(1.0, 1.0, 0.0))
    add(statistics, {0: Pose2(5.5, 5.0, 0.0), 1: START[1]})
    add(statistics, {1: START[1]})
    statistics.set_down(0, Pose2(9.0, 9.0, 0.0))
    add(statistics, {0: Pose2(9.0, 9.5, 0.0), 1: START[1]})
    assert [(robot.distance_m, robot.pose.x) for robot in statistics.robots()] == [(1.0, 9.0), (0.0, 0.0)]


def test_a_stall_counts_once_however_long_it_lasts() -> None:
    """It counts again after the robot was free."""
    statistics = started()
    for stalled in ([0], [0], [], [0]):
        add(statistics, START, stalled)
    assert [robot.stalls for robot in statistics.robots()] == [2, 0]


def test_a_gap_has_mean_maximum_and_end() -> None:
    """The follower has it, in metres between the centres; without its leader in the world it has none."""
    statistics = started()
    add(statistics, {1: START[1]})
    assert statistics.robots()[1].gap_m is None
    for y in (1.0, 4.0, 1.0):
        add(statistics, {0: START[0], 1: Pose2(0.0, y, 0.0)})
    leader, follower = statistics.robots()
    assert (leader.gap_m, follower.gap_m) == (None, Gap(2.0, 4.0, 1.0))
    assert (leader.follow, follower.follow) == (None, 0)


def test_late_steps_count_from_the_second_tick_after_go() -> None:
    """GO may arrive after the scans of two ticks, so that before that a robot may rightly have sent no command."""
    statistics = started(tick=10)
    for tick in (10, 11):
        statistics.add_late_steps(tick, [0, 1])
    assert [robot.late_steps for robot in statistics.robots()] == [0, 0]
    statistics.add_late_steps(12, [0, 1])
    add(statistics, {**START, 5: START[0]})
    statistics.add_late_steps(13, [1, 5, 7])
    assert [robot.late_steps for robot in statistics.robots()] == [1, 2, 1]


def test_the_trajectory_is_that_of_all_poses() -> None:
    """x, y, yaw by id as little-endian 64-bit floats; yaws are the same bits as `normalize_angle` makes."""
    statistics, expected = started(), hashlib.sha256()
    rng = np.random.default_rng(4)
    for _ in range(300):
        poses = {i: Pose2(*rng.normal(0.0, 9.0, 3).tolist()) for i in (0, 1)}
        add(statistics, poses)
        for x, y, yaw in poses.values():
            expected.update(struct.pack("<3d", x, y, normalize_angle(yaw)))
    assert statistics.trajectory_sha256 == expected.hexdigest()


def test_latencies_are_given_in_milliseconds() -> None:
    """The median and the 99th percentile of all."""
    statistics = started()
    for i in range(100, 0, -1):
        statistics.add_latency(i / 1000)
    latency = statistics.latency()
    assert latency.p50 == pytest.approx(51.0)
    assert latency.p99 == pytest.approx(100.0)
    assert latency.count == 100


def test_wall_time_needs_two_ticks() -> None:
    """With one there is no time between the first and the last."""
    statistics = started()
    add(statistics, START)
    assert statistics.wall_seconds == 0.0
    add(statistics, START)
    assert statistics.wall_seconds > 0.0
    assert statistics.ticks == 2


def test_starting_anew_forgets_the_run() -> None:
    """The next GO counts from zero."""
    statistics = started()
    add(statistics, START, [0], {0: 1})
    statistics.add_external_command()
    statistics.add_latency(1.0)
    statistics.start_anew()
    assert statistics.go_stamp is None
    assert (statistics.ticks, statistics.external_commands, statistics.robots()) == (0, 0, [])
    assert statistics.latency().count == 0
    assert statistics.trajectory_sha256 == hashlib.sha256().hexdigest()


def test_only_the_newest_latencies_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """A long run forgets the first ones, and takes no more memory for those that come."""
    monkeypatch.setattr("zteam.simulator.process.statistics._MAX_LATENCIES", 3)
    statistics = started()
    for seconds in (0.9, 0.1):
        statistics.add_latency(seconds)
    assert statistics.latency().count == 2
    for seconds in (0.2, 0.3):
        statistics.add_latency(seconds)
    assert statistics.latency() == Latency(200.0, 300.0, 3)


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's time, which the test sets."""
    time = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: time[0])
    return time


def spend(host: list[float], profile: TickProfile, phase: Phase, seconds: float) -> None:
    """Let a phase take this long."""
    host[0] += seconds
    profile.end(phase)


def test_the_timing_is_the_mean_of_whole_ticks(host: list[float]) -> None:
    """In milliseconds; the open tick does not count."""
    profile = TickProfile()
    for seconds in (0.001, 0.003):
        spend(host, profile, "physics", seconds)
        spend(host, profile, "sensors", 0.010)
        profile.end_tick()
    spend(host, profile, "physics", 9.0)
    timing = profile.timing()
    assert (timing.physics, timing.sensors) == (pytest.approx(2.0), pytest.approx(10.0))
    assert (timing.wait, timing.publish, timing.idle) == (0.0, 0.0, 0.0)


def test_a_start_forgets_what_was_before(host: list[float]) -> None:
    """The open tick's phases included; without a whole tick all is zero."""
    profile = TickProfile()
    assert profile.timing() == Timing(0.0, 0.0, 0.0, 0.0, 0.0)
    spend(host, profile, "physics", 5.0)
    host[0] += 5.0
    profile.start()
    spend(host, profile, "physics", 0.001)
    profile.end_tick()
    assert profile.timing().physics == pytest.approx(1.0)


def test_the_last_tick_in_words_names_what_took_time(host: list[float]) -> None:
    """In the order of a tick, without idle time and phases that took none."""
    profile = TickProfile()
    for phase, seconds in (("sensors", 0.1126), ("physics", 0.002), ("idle", 1.0)):
        spend(host, profile, phase, seconds)
    profile.end_tick()
    assert profile.last_text() == "physics 2.0 ms, sensors 112.6 ms"
