"""The monitor's table as text: what its rows say, at which width."""

import pytest

from support.gate_feed import come
from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.messages import Header, RobotDriver, RobotState, RobotStatus, time_from_ns
from zteam.monitor.process.members import SILENT_AFTER
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.table import Row, format_table, make_rows, team_notes
from zteam.node.launcher import Restarted

POSE = Pose2(-12.345, 8.5, -3.1)


def lines_of(rows: list[Row], notes: tuple[str, ...] = (), width: int = 80) -> list[str]:
    """The table's lines."""
    return [line.text for line in format_table(rows, notes, width)]


def test_a_row_says_state_behaviour_pose_speed_age_and_reason() -> None:
    """Behaviour and leader, pose in `map`, speed of the newest command, age of the status, and why it stands."""
    gate = Gate([0, 1], 2)
    for i, (speed, reason) in enumerate([(0.4, ""), (0.0, "obstacle ahead")]):
        gate.take_token(i, True)
        status = RobotStatus(
            robot_id=i, is_ready=True, state=RobotState.RUNNING, text=reason, behavior="follow" if i else "wander",
            driver=RobotDriver.BEHAVIOR, reason=reason, leader=i - 1, speed=speed,
        )  # fmt: skip
        gate.take_status(i, status, 10.0)
    assert lines_of(make_rows(gate, {0: POSE}, {}, 10.25), width=120) == [
        "robot    state    behaviour            x     y    yaw   m/s    age",
        "robot_0  running  wander          -12.35  8.50  -3.10  0.40  0.2 s",
        "robot_1  running  follow robot_0       -     -      -  0.00  0.2 s  obstacle ahead",
    ]


def running(robot_id: int, stamp: float, speed: float = 0.2) -> RobotStatus:
    """The status of a robot that drives, at `stamp` seconds of the team's time."""
    header = Header(time_from_ns(to_ns(stamp)))
    return RobotStatus(header, robot_id, is_ready=True, state=RobotState.RUNNING, speed=speed)


def test_a_robot_without_data_shows_no_speed() -> None:
    """Where a robot's time stands still its last speed is an old one; it shows again when time goes on, by its own
    statuses or by the simulator's ticks, as in lock-step, where a slow world repeats a status."""
    gate = Gate([0], 1)
    gate.take_token(0, True)

    def row(now: float) -> tuple[float | None, str]:
        (found,) = make_rows(gate, {}, {}, now)
        return found.speed, found.reason

    for now in (10.0, 11.0, 12.0, 13.0):
        gate.take_status(0, running(0, min(now, 11.5)), now)
    assert row(13.0) == (0.2, "")
    gate.take_status(0, running(0, 11.5), 15.2)
    assert row(15.2) == (None, "no data since 11.5 s")
    gate.take_tick(115, 16.0)
    assert row(16.0) == (0.2, "")
    gate.take_tick(115, 20.0)
    gate.take_status(0, running(0, 11.5), 20.0)
    assert row(20.0) == (None, "no data since 11.5 s")
    gate.take_status(0, running(0, 12.0), 20.5)
    assert row(20.5) == (0.2, "")


def test_a_robot_by_the_hosts_clock_says_how_long_it_has_no_data() -> None:
    """A stamp of the host's clock is no time of a run."""
    gate = Gate([0], 1)
    gate.take_token(0, True)
    gate.take_status(0, running(0, 1.8e9), 10.0)
    (row,) = make_rows(gate, {}, {}, 14.0)
    assert (row.speed, row.reason) == (None, "no data for 4 s")


def test_a_robot_that_is_stopped_says_so_in_each_state() -> None:
    """Its row has the way out, also before GO, and so has a line below; a process that is gone stops nothing."""
    gate = Gate([0, 1, 2], 3)
    for i, state in enumerate((RobotState.READY, RobotState.RUNNING, RobotState.RUNNING)):
        gate.take_token(i, True)
        gate.take_status(i, RobotStatus(robot_id=i, is_ready=True, state=state, is_stopped=True), 10.0)
    gate.take_token(2, False)
    rows = make_rows(gate, {}, {}, 10.0)
    stopped = "stopped (zteam stop --release)"
    assert [(row.state, row.reason, row.is_stopped) for row in rows[:2]] == [
        ("ready", stopped, True), ("running", stopped, True),
    ]  # fmt: skip
    assert not rows[2].is_stopped
    assert f"robot 0, 1: {stopped}" in team_notes(gate, {}, [])


def test_every_robot_has_a_state() -> None:
    """Robots without a process, lost, stopped, hung ones and those at fault, each with what is known of it."""
    gate = Gate([0, 1, 2, 3, 4, 5], 6)
    come(gate, 0, state=RobotState.FAULT)
    come(gate, 1, 2, 3)
    come(gate, 2, state=RobotState.STOPPED)
    gate.take_token(1, False)
    gate.take_token(2, False)
    gate.take_token(4, True)
    gate.check_silence(SILENT_AFTER + 1)
    gate.take_world([0, 1, 2, 3, 4])
    rows = make_rows(gate, {}, {}, SILENT_AFTER + 2)
    assert [row.state for row in rows] == ["silent", "lost", "stopped", "silent", "absent", "absent"]
    assert [row.reason for row in rows[1:3]] == ["its process is gone"] * 2
    assert rows[0].reason == rows[3].reason == "does not answer"
    assert rows[0].speed is rows[3].speed is None
    assert rows[4].reason == "no status yet"
    assert rows[5].reason.startswith("not in the world; it has 0-4 ('zteam sim spawn --id 5")


def test_a_robot_that_was_taken_out_of_the_world_is_told_as_that() -> None:
    """Its own reason, such as a stale scan, follows from it; a robot with another source of scans stands for none."""
    gate = Gate([0, 1], 2)
    for i, reason in enumerate(["stale scan", ""]):
        gate.take_token(i, True)
        gate.take_status(i, RobotStatus(robot_id=i, state=RobotState.RUNNING, reason=reason), 10.0)
    gate.take_world([])
    told, drives = make_rows(gate, {}, {}, 10.0)
    assert told.reason == "not in the world; it has no robot ('zteam sim spawn --id 0 --pose X Y YAW' adds it)"
    assert drives.reason == ""


def test_a_long_reason_stands_below_its_row() -> None:
    """At 80 columns nothing is cut or wider; the reason is wrapped below its row, under the state."""
    reason = "waiting for a first scan (robot_3/base_scan), odometry (robot_3/odom), its own pose in map"
    row = Row("robot_3", "boot", "follow robot_2", POSE, 0.0, 0.4, reason)
    shown = lines_of([row], ("waiting for robot_3: " + reason,))
    assert max(map(len, shown)) <= 80
    assert shown[2:4] == [
        "         waiting for a first scan (robot_3/base_scan), odometry (robot_3/odom),",
        "         its own pose in map",
    ]
    assert " ".join(shown[4:]) == "waiting for robot_3: " + reason


def test_the_widest_row_fits_a_terminal() -> None:
    """A long behaviour is cut, so that a row with wide numbers has 80 characters at most."""
    row = Row("robot_10", "running", "my_package.robots:TurnerOfTables", Pose2(-100.0, -100.0, -3.14), -0.55, 12.3)
    shown = lines_of([row])
    assert max(map(len, shown)) <= 80
    assert "my_package.robots:T…" in shown[1]


@pytest.mark.parametrize("driver", [RobotDriver.NAVIGATION, RobotDriver.TELEOP])
def test_another_driver_is_named(driver: str) -> None:
    """Where something else than the behaviour commands the wheels, the row says so."""
    gate = Gate([0], 1)
    gate.take_token(0, True)
    gate.take_status(0, RobotStatus(state=RobotState.RUNNING, behavior="wander", driver=driver), 0.0)
    assert make_rows(gate, {}, {}, 0.0)[0].behavior == f"{driver} (wander)"


def test_the_notes_tell_of_go_and_of_what_is_wrong() -> None:
    """Before GO what it waits for, then that it is out, and below it what else is wrong."""
    gate = Gate([0], 1)
    assert team_notes(gate, {}, ["the simulator is gone"]) == [
        "waiting for robot_0",
        "the simulator is gone",
    ]
    assert make_rows(gate, {}, {}, 0.0)[0].reason == "no process yet"
    come(gate, 0)
    gate.try_go(1)
    assert team_notes(gate, {}, []) == ["GO is out"]


def test_what_was_started_again_is_told() -> None:
    """Robots and nodes below the table, and each robot's count in its row, for `--json`."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1)
    restarts = {"robot_1": Restarted(2, 0.234), "planner": Restarted(1)}
    assert team_notes(gate, restarts, ["the simulator is gone"])[1:] == [
        "started again: planner 1 time, robot_1 2 times (back after 0.2 s)",
        "the simulator is gone",
    ]
    assert [row.restarts for row in make_rows(gate, {}, restarts, 0.0)] == [0, 2]
