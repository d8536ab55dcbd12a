"""What the monitor tells of lost robots, hung robots and a lost router."""

import msgspec
import pytest

from support.monitor_desk import FLICKER, LOSS, RETURNED, Open, Robot
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.clock import FREEZES
from zteam.monitor.process import watch
from zteam.monitor.process.start_gate import SILENT_AFTER
from zteam.simulator.client import SimStatus

SCENARIOS: dict[str, tuple[list[str | float], list[tuple[str, int | None]]]] = {
    "a token that only flickers is no loss": (["gone 0", "gone 1", FLICKER, "back 0", LOSS], [("lost", 1)]),
    "nor are tokens that vanish just before the link": (
        ["gone 0", "gone 1", "link lost", 10.0, "link up", "back 0", "back 1", RETURNED],
        [("link", None), ("link", None)],
    ),
    "or just after it": (
        ["link lost", "gone 0", "gone 1", 5.0, "link up", "back 0", "back 1", RETURNED],
        [("link", None), ("link", None)],
    ),
    "a robot that died while the router was away is lost": (
        ["gone 0", "gone 1", "link lost", 5.0, "link up", "back 0", RETURNED],
        [("link", None), ("link", None), ("lost", 1)],
    ),
    "no robot is silent while the router is away, nor at once when it is back": (
        ["link lost", 2 * SILENT_AFTER, "link up", 0.0, 0.9 * SILENT_AFTER], [("link", None), ("link", None)],
    ),
    "a robot that hangs is silent, and not lost": (
        [0.9 * SILENT_AFTER, "says 1", 0.2 * SILENT_AFTER, "says 0", LOSS], [("silent", 0), ("answers", 0)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_losses_are_told_once_they_are_certain(hub: MemoryHub, open_desk: Open, scenario: str) -> None:
    """Two robots are ready, their tokens and the link come and go, and host time (s) passes."""
    steps, told = SCENARIOS[scenario]
    desk, robots = open_desk(0, 1, 9), [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
    for step in steps:
        what, _, whom = step.partition(" ") if isinstance(step, str) else ("", "", "")
        if isinstance(step, float):
            desk.pass_by(step)
        elif what == "link":
            desk.link.set_link(whom == "up")
        elif what == "says":
            robots[int(whom)].say()
        else:
            (robots[int(whom)].vanish if what == "gone" else robots[int(whom)].appear)()
    assert desk.told("lost", "back", "silent", "answers", "link") == told


def test_a_name_is_lost_with_its_last_holder(hub: MemoryHub, open_desk: Open) -> None:
    """While another session holds the name of a robot that ends, the robot is not lost. A robot whose status came
    before its token counts."""
    desk, first, second = open_desk(team_size=1), Robot(hub, 0, present=False), Robot(hub, 0, present=False)
    first.say()
    for robot in (first, second):
        robot.appear()
    desk.event("go")
    first.vanish()
    desk.pass_by(LOSS)
    assert (desk.told("lost"), desk.monitor.gate.ready) == ([], [0])
    second.vanish()
    desk.pass_by(LOSS)
    assert desk.told("lost") == [("lost", 0)]


def test_no_go_without_a_router(hub: MemoryHub, open_desk: Open) -> None:
    """No robot would get it; it is given when the router is back."""
    desk, robot = open_desk(0), Robot(hub, 0)
    desk.link.set_link(False)
    robot.say()
    assert desk.told("go") == []
    desk.link.set_link(True)
    desk.event("go")
    assert [event.text for event in desk.events if event.kind == "link"] == ["router lost", "router is back"]


@pytest.mark.parametrize(
    ("name", "gone", "back"),
    [
        (names.SIMULATOR, "the simulator is gone: time stands still", "the simulator is back"),
        (names.AGGREGATOR, "the aggregator is gone: there are no new transforms", "the aggregator is back"),
    ],
)
def test_a_server_that_is_gone_is_named(hub: MemoryHub, open_desk: Open, name: str, gone: str, back: str) -> None:
    """The simulator and the aggregator are told as gone and as back; the table's notes have it meanwhile."""
    desk, bus = open_desk(0), hub.bus()
    assert desk.monitor.watch.notes() == ["no aggregator yet (zteam-tf): poses are not known"]
    token = bus.declare_token(names.token_key(name, bus.instance))
    desk.look()
    token.close()
    desk.pass_by(FLICKER)
    assert desk.told("process") == []
    desk.pass_by(LOSS)
    assert gone in desk.monitor.watch.notes()
    bus.declare_token(names.token_key(name, bus.instance))
    assert [event.text for event in desk.events if event.kind == "process"] == [gone, back]
    assert gone not in desk.monitor.watch.notes()
    desk.link.set_link(False)
    desk.look()
    assert desk.monitor.watch.notes()[0] == "the router is lost: nothing can be heard"


@pytest.mark.parametrize("frozen", [True, False])
def test_a_monitor_that_hears_nobody_accuses_no_robot(
    hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch, frozen: bool
) -> None:
    """It was frozen itself, or the router is silent and no process answers; a robot that stays silent after that is
    reported."""
    desk, robot = open_desk(0), Robot(hub, 0, answers=frozen)
    robot.say()
    desk.look()
    if frozen:
        monkeypatch.setattr(FREEZES, "look", lambda: 1.0)
    desk.pass_by(SILENT_AFTER * 3)
    assert desk.told("silent") == []
    desk.pass_by(SILENT_AFTER * 1.1)
    assert desk.told("silent") == [("silent", 0)] * frozen


@pytest.mark.parametrize(
    ("changes", "note"),
    [
        ({}, ""),
        ({"paused": True}, "time stands still: the simulator is paused"),
        ({"paused": True, "finished": True}, "time stands still: the run is over"),
        ({"lockstep": True, "waiting_for": "robot_3"}, "time stands still: lock-step waits for robot_3"),
        (None, "the simulator does not answer"),
    ],
)
def test_a_world_that_stands_still_is_noted(
    hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch, changes: dict[str, object] | None, note: str
) -> None:
    """By what its simulator answers after GO, or does not. In lock-step a world may wait for a moment in every tick."""
    monkeypatch.setattr(watch, "LOOK", 0.0)
    desk, simulator = open_desk(0), hub.bus()
    simulator.declare_token(names.token_key(names.SIMULATOR, simulator.instance))
    if changes is not None:
        status = msgspec.structs.replace(SimStatus("w", [0], 100, 1, 0, 7, 1.0), **changes)
        simulator.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    Robot(hub, 0).say()
    desk.event("go")
    assert not any("lock-step" in text for text in desk.monitor.watch.notes())
    desk.pass_by(1.1 * SILENT_AFTER)
    notes = desk.monitor.watch.notes()
    assert note in notes if note else not any("time stands still" in text for text in notes)
