"""The document `team`, as the page's table shows it."""

from typing import Any

import msgspec
import numpy as np

from zteam.geometry import Pose2
from zteam.messages import (
    BaseInfo,
    Point32,
    Polygon,
    PoseWithCovarianceStamped,
    RobotState,
    RobotStatus,
    TeamState,
    TeamStatus,
)
from zteam.simulator.client import RobotShape, SimStatus
from zteam.view.scene import Outlines, gate_row, robot_row, sim_row

RUNNING = RobotStatus(robot_id=1, state=RobotState.RUNNING, behavior="follow", driver="behavior", leader=0, speed=0.4)


def row_of(**heard: Any) -> dict[str, Any]:
    """The row of a robot that is there."""
    return robot_row(1, Outlines(), present=True, **heard)


def test_a_robots_body_is_that_of_its_world() -> None:
    """Without a simulator it is the outline of `base_info`."""
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
    base = BaseInfo(model="real", footprint=Polygon([Point32(*point) for point in square]))
    outlines, two = Outlines(), RobotShape("erratic", [square, square], [(0.1, 0.0, 0.2)])
    rows = [
        robot_row(1, outlines, present=True, base=has_base, shape=shape)
        for has_base, shape in ((None, None), (base, two), (base, None), (None, two))
    ]
    assert [(row["model"], row["outline"]) for row in rows] == [("", -1), ("erratic", 0), ("real", 1), ("erratic", 0)]
    found = [msgspec.json.decode(outline, type=list[list[tuple[float, float]]]) for outline in outlines]
    assert found == [[square, square], [square]]


def test_a_robot_is_stopped_by_its_own_word_or_by_the_simulators() -> None:
    """Either of them holds it."""
    sim = SimStatus("arena", [0, 1], 100, 1, 0, 0, 1.0, stopped=[1])
    held = msgspec.structs.replace(RUNNING, is_stopped=True)
    told = (None, None), (None, RUNNING), (None, held), (sim, RUNNING)
    assert [row_of(alive=True, sim=world, status=status)["stopped"] for world, status in told] == [
        False, False, True, True,
    ]  # fmt: skip
    assert not row_of(status=held)["stopped"]


def test_states_are_those_of_the_monitor() -> None:
    """A robot is absent, running, silent, lost or stopped, with the reason in words."""
    stopped = RobotStatus(state=RobotState.STOPPED)
    rows = [
        row_of(),
        row_of(alive=True),
        row_of(alive=True, status=RUNNING, age=0.5),
        row_of(alive=True, status=RUNNING, age=9.0),
        row_of(status=RUNNING),
        row_of(status=stopped),
    ]
    assert [row["state"] for row in rows] == ["undriven", "absent", "running", "silent", "lost", "stopped"]
    assert [row["reason"] for row in rows[:2]] == ["drive it, or start one", "no status yet"]
    assert (rows[2]["speed"], rows[2]["leader"], rows[2]["behavior"], rows[2]["age"]) == (0.4, 0, "follow", 0.5)


def test_a_reason_cannot_command_a_page_or_terminal() -> None:
    """Control characters are replaced."""
    status = RobotStatus(state=RobotState.RUNNING, reason="a\x1b[2Jb")
    assert row_of(alive=True, status=status)["reason"] == "a\ufffd[2Jb"


def test_the_gate_tells_what_it_waits_for() -> None:
    """In the monitor's words, or by name; GO, and no monitor, as such."""
    status = TeamStatus(team_size=3, ready=np.array([0]), missing=np.array([1, 2]))
    for waits in ("robot_1 (no scan)", ""):
        gate = gate_row(msgspec.structs.replace(status, waiting_for=waits))
        assert gate == {"state": "waiting", "text": f"1 of 3 ready; waiting for {waits or 'robot_1, robot_2'}"}
    assert gate_row(TeamStatus(state=TeamState.GO))["state"] == "go"
    assert gate_row(None)["text"] == "no monitor"


def test_the_simulator_runs_stands_or_is_not_there() -> None:
    """Its models are those that can be spawned."""
    status = SimStatus("w", [0], 100, 1, 0, 5, 0.987, paused=True, lockstep=True, waiting_for="robot_1")
    row = sim_row(status, ["b", "a"])
    assert row == {
        "present": True, "world": "w", "state": "paused", "speed": 1.0, "rtf": 0.99, "lockstep": True,
        "waits_for": "robot_1", "models": ["a", "b"],
    }  # fmt: skip
    assert [sim_row(None, (), world)["state"] for world in ("", "w")] == ["", "gone"]


def place_row(places: tuple[Pose2, Pose2] | None = None, variance: float = 0.0, **world: Any) -> dict[str, Any]:
    """The row of a running robot after a localiser's word, in a world that runs unless told."""
    amcl, sim = PoseWithCovarianceStamped(), SimStatus("w", [1], 100, 1, 0, 5, 1.0, **world)
    amcl.pose.covariance = amcl.pose.covariance.copy()
    amcl.pose.covariance[7] = variance
    return row_of(alive=True, status=RUNNING, sim=sim, processes=["robot_1"], amcl=amcl, places=places)


def test_a_lost_robot_says_so() -> None:
    """By its own doubt, or by where it really is: then with that pose, for its ghost."""
    here, near, turned = Pose2(0.0, 0.0, 0.0), Pose2(0.9, 0.0, 0.5), Pose2(0.0, 0.0, 0.7)
    assert place_row((near, here))["localised"]
    assert [row["truth"] for row in (place_row((turned, here)), place_row((near, here)))] == [[0.0, 0.0, 0.7], None]
    lost = place_row((Pose2(2.1, 0.0, 0.0), here))
    assert (lost["localised"], lost["reason"]) == (False, "localisation lost: about 2 m and 0° off")
    assert place_row(variance=0.9)["localised"]
    assert place_row(variance=2.25)["reason"] == "localisation lost: its place is known to ± 1.5 m only"


def test_a_robot_stands_for_a_reason() -> None:
    """Without a word of its own, and when it was taken out of the world: then it does not run, whatever it says."""
    standing = msgspec.structs.replace(RUNNING, speed=0.0)
    assert row_of(alive=True, status=standing)["reason"]
    sim = SimStatus("w", [], 100, 1, 0, 5, 1.0)
    gone = robot_row(1, Outlines(), present=False, alive=True, status=RUNNING, sim=sim, processes=["nav_1", "robot_1"])
    assert gone["reason"] == "not in the world; nav_1, robot_1 still run"
    assert (gone["state"], gone["speed"]) == ("absent", None)
