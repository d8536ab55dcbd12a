"""A whole team in lock-step: changes of world and processes between ticks, and disturbed starts."""

import math
from collections.abc import Callable

import pytest

from support.in_process_team import NAMES, InProcessTeam, TeamOptions, run
from support.lockstep_doubles import lose_first, lossy_bus
from support.log_capture import captured_log
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.errors import BusError
from zteam.messages import LaserScan
from zteam.nodes.simulator import patience
from zteam.services.simulator import MoveRequest, RemoveRequest, SimReport, SimStatus, SpawnReply, SpawnRequest

SOON = 20.0
"""Host seconds after which a start, which takes milliseconds, counts as stuck."""


def steps(*changes: Callable[[InProcessTeam], object]) -> SimReport:
    """A run in steps of 20 ticks with these changes in between; its report."""
    with InProcessTeam(TeamOptions(paused=True, run_for=None)) as team:
        for change in changes:
            team.step(20)
            change(team)
        team.step(20)
        return team.report()


def position(report: SimReport, robot_id: int) -> tuple[float, float]:
    """The robot's last position (m)."""
    (found,) = (robot for robot in report.robots if robot.id == robot_id)
    return found.pose[:2]


@pytest.mark.parametrize("ticks", [1, 37, 95])
def test_a_reset_starts_the_same_run_again(ticks: int) -> None:
    """A reset in the middle of a run makes all processes forget that run."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(ticks)
        team.ask("reset")
        team.ask("resume")
        report = team.finish()
    assert (report.ticks, report.hung, report.resends) == (101, [], 0)
    assert report.trajectory_sha256 == run().trajectory_sha256


def test_a_finished_run_may_be_run_again_and_again() -> None:
    """Each run has the same hash; GO stays given."""
    with InProcessTeam() as team:
        hashes = {team.finish().trajectory_sha256}
        for _ in range(3):
            team.ask("reset")
            hashes.add(team.finish().trajectory_sha256)
    assert len(hashes) == 1


def test_a_reset_undoes_what_was_changed() -> None:
    """Robots that were added, removed or moved are as at the start."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(10)
        team.ask("spawn", SpawnReply, SpawnRequest(2.0, 0.0))
        team.ask("remove", SimStatus, RemoveRequest(2))
        team.ask("move", SimStatus, MoveRequest(0, 1.0, -1.0))
        team.step(10)
        assert team.ask("reset").robots == [0, 1, 2]
        team.ask("resume")
        assert team.finish().trajectory_sha256 == run().trajectory_sha256


def test_a_robot_may_be_moved() -> None:
    """It drives on from its new place, and its follower turns to it there."""
    report = steps(lambda team: team.ask("move", SimStatus, MoveRequest(0, 0.0, -1.5, -math.pi / 2)))
    x, y = position(report, 0)
    assert x == pytest.approx(0.0, abs=0.1)
    assert -3.5 < y < -2.0
    calm = steps()
    assert position(report, 1)[1] < position(calm, 1)[1] - 0.1


def test_a_robot_may_be_removed() -> None:
    """Its process still takes part and delays no tick; its follower stands."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        assert team.ask("remove", SimStatus, RemoveRequest(0)).robots == [1, 2]
        team.step(20)
        before = position(team.report(), 1)
        status = team.step(20)
        assert status.participants == sorted(NAMES)
        assert status.waiting_for == ""
        assert position(team.report(), 1) == pytest.approx(before, abs=1e-6)
        assert "leader robot_0 not seen" in team.texts["robot_1"]


def test_a_robot_may_be_added_and_driven() -> None:
    """The new robot and its process take part from the next tick on, and GO holds for them."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        assert team.ask("spawn", SpawnReply, SpawnRequest(-3.5, -1.5)) == SpawnReply(3)
        assert team.step(5).robots == [0, 1, 2, 3]
        still = position(team.report(), 3)
        assert still == pytest.approx((-3.5, -1.5))
        team.bring(["robot_3"])
        assert team.ask("status").joining == ["robot_3"]
        assert team.step(30).participants == ["robot_0", "robot_1", "robot_2", "robot_3", "tf"]
        assert math.dist(position(team.report(), 3), still) > 0.5
        assert team.report().hung == []


def test_changes_are_repeatable_too() -> None:
    """The same changes after the same ticks make the same run."""

    def change(team: InProcessTeam) -> None:
        team.ask("spawn", SpawnReply, SpawnRequest(-3.5, -1.5))
        team.bring(["robot_3"])

    changes = (
        change,
        lambda team: team.ask("move", SimStatus, MoveRequest(2, 0.0, 3.0, 1.0)),
        lambda team: team.ask("remove", SimStatus, RemoveRequest(1)),
        lambda team: team.ask("spawn", SpawnReply, SpawnRequest(-3.5, 3.5, 0.0, id=1)),
    )
    assert steps(*changes).trajectory_sha256 == steps(*changes).trajectory_sha256 != steps().trajectory_sha256


def test_what_cannot_be_changed_changes_nothing() -> None:
    """An unknown robot or an id that is taken: the error names it, and the run is the same."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(10)
        for service, request in (
            ("remove", RemoveRequest(9)),
            ("move", MoveRequest(9, 0.0, 0.0)),
            ("spawn", SpawnRequest(0.0, 0.0, id=1)),
            ("spawn", SpawnRequest(0.0, 0.0, model="unicorn")),
        ):
            with pytest.raises(BusError, match=r"robot 9|robot 1|unicorn"):
                team.ask(service, SimStatus, request)
        team.ask("resume")
        assert team.finish().trajectory_sha256 == run().trajectory_sha256


def test_a_process_may_end_and_come_back() -> None:
    """The world does not wait for it, its robot stops, and the new process drives at once: GO stays given."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        team.end("robot_0")
        assert team.step(10).participants == ["robot_1", "robot_2", "tf"]
        stood = position(team.report(), 0)
        team.step(10)
        assert position(team.report(), 0) == stood
        team.bring(["robot_0"])
        assert team.step(10).participants == sorted(NAMES)
        assert math.dist(position(team.report(), 0), stood) > 0.1
        assert (team.report().hung, team.report().resends) == ([], 0)


def test_the_aggregator_may_end_and_come_back() -> None:
    """Without transforms the followers stop; with the new aggregator they follow again."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        team.end("tf")
        assert team.step(20).participants == ["robot_0", "robot_1", "robot_2"]
        stood = position(team.report(), 1)
        team.step(10)
        assert position(team.report(), 1) == pytest.approx(stood, abs=1e-6)
        team.bring(["tf"])
        team.step(20)
        assert math.dist(position(team.report(), 1), stood) > 0.1


def test_a_repeat_changes_nothing() -> None:
    """Data that is sent again while the world stands still arrives, and moves no robot."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        scans: list[LaserScan] = []
        team.hub.bus().subscribe(names.scan_key(1, 0), LaserScan, lambda _, scan: scans.append(scan))
        team.ask("repeat")
        assert len(scans) == 1
        team.ask("resume")
        assert team.finish().trajectory_sha256 == run().trajectory_sha256


def test_a_start_survives_lost_transforms(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that misses the held tick's transforms receives them again and becomes ready."""
    monkeypatch.setattr(patience, "RESEND", 0.002)
    monkeypatch.setattr(patience, "MAX_RESEND", 0.01)

    def open_bus(hub: MemoryHub, name: str) -> Bus:
        return lossy_bus(hub, lose_first(names.TF, 20)) if name == "robot_2" else hub.bus()

    with InProcessTeam(TeamOptions(order=NAMES[::-1], staggered=True), open_bus=open_bus) as team:
        assert team.finish(SOON).trajectory_sha256 == run().trajectory_sha256


def test_a_start_survives_an_aggregator_that_takes_its_name_late() -> None:
    """Transforms that it received before it may answer ticks are in the bundle that it repeats later."""
    team = InProcessTeam(TeamOptions(staggered=True))
    team.prepare(names.AGGREGATOR)
    aggregator = team.nodes[names.AGGREGATOR]

    def win(_key: str, _scan: LaserScan) -> None:
        if not aggregator.present:
            aggregator.become_present()

    team.hub.bus().subscribe(names.scan_key(2, 0), LaserScan, win)
    with team:
        assert team.finish(SOON).trajectory_sha256 == run().trajectory_sha256


def test_a_new_process_receives_latched_messages() -> None:
    """They arrive while it is being made, without any error."""
    with captured_log() as log, InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(1)
    assert log.count("error while handling") == 0


def test_a_process_that_gives_its_name_back_publishes_no_more() -> None:
    """It does not answer the tick that tells the others of its end, so no answer has to be dropped."""
    with captured_log() as log, InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(1)
        team.end("robot_2")
        team.step(1)
        assert log.count("no process holds this name") == 0


def test_a_place_without_room_is_refused_unless_forced() -> None:
    """A wall, another robot, outside of the world: the error has the reason. With force the robot stands there."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(10)
        x, y = position(team.report(), 1)
        for pose, why in (((-4.95, 0.0), "'west'"), ((x, y), "in robot 1"), ((40.0, 0.0), "outside of the world")):
            with pytest.raises(BusError, match=f"no room.*{why}.*--force"):
                team.ask("move", SimStatus, MoveRequest(0, *pose))
            with pytest.raises(BusError, match=f"no room.*{why}.*--force"):
                team.ask("spawn", SpawnReply, SpawnRequest(*pose))
        assert team.ask("status").robots == [0, 1, 2]
        assert team.ask("spawn", SpawnReply, SpawnRequest(-4.95, 3.0, force=True)) == SpawnReply(3)
        team.ask("move", SimStatus, MoveRequest(0, 0.0, -4.95, force=True))
        team.step(30)
        assert position(team.report(), 0) == pytest.approx((0.0, -4.95))
        assert position(team.report(), 3) == pytest.approx((-4.95, 3.0))
