"""A recording instead of a team: what pages receive of it, what they may ask, and what a jump back forgets."""

from collections.abc import Iterator

import pytest

from support.fake_replay import PLANNED, TICK, FakeReplay
from support.transforms import S
from support.transports import wait_until_true
from support.web_view import Page, View, open_page, open_view
from zteam.bus import MemoryHub
from zteam.clock import pause
from zteam.messages import Header, OccupancyGrid, Path, PoseStamped, encode, time_from_ns
from zteam.view.queries import REPLAY_PERIOD
from zteam.view.received import Received, Viewer


@pytest.fixture
def replay() -> FakeReplay:
    """A recording that stands at its beginning."""
    return FakeReplay(MemoryHub())


@pytest.fixture
def view(replay: FakeReplay) -> Iterator[View]:
    """A view of it."""
    with open_view(replay.hub.bus()) as view:
        yield view


def wait_for_tick(page: Page, tick: int) -> None:
    """Wait until the page has the recording's document and its poses."""
    page.wait(lambda: (page.docs.get("replay") or {}).get("tick") == tick)
    page.wait(lambda: page.frames[-1].stamp == pytest.approx(tick * TICK / S))


def test_a_page_is_told_of_a_recording_that_stands(view: View, replay: FakeReplay) -> None:
    """It has no part in what was sent before, so the view asks for that again; its robots are taken for alive."""
    replay.play(PLANNED)
    with open_page(view.port) as page:
        page.say(op="look", layers=["plans", "scans"])
        wait_for_tick(page, PLANNED)
        page.wait(lambda: [robot["state"] for robot in page.docs["team"]["robots"]] == ["running"])
        assert page.docs["replay"]["file"] == replay.status.file
        replay.end()
        page.wait(lambda: page.docs["replay"] is None)


def test_each_change_is_carried_out_and_shown(view: View, replay: FakeReplay) -> None:
    """The page has the new state without waiting for the next look."""
    with open_page(view.port) as page:
        wait_for_tick(page, 1)
        replay.asked.clear()
        assert page.command(op="replay_seek", time=20.0) == ""
        wait_for_tick(page, 200)
        assert page.command(op="replay_step", ticks=-3) == ""
        wait_for_tick(page, 197)
        for command in ({"op": "replay_resume"}, {"op": "replay_speed", "factor": 0.25}, {"op": "replay_pause"}):
            assert page.command(**command) == ""
        assert [it for it in replay.asked if it[0] != "seek"] == [
            ("step", -3), ("is_paused", False), ("speed", 0.25), ("is_paused", True),
        ]  # fmt: skip
        assert replay.asked[0] == ("seek", 20.0)


def test_a_recording_takes_no_other_command(view: View, replay: FakeReplay) -> None:
    """Neither stop, which needs no token, nor a lease; and without the token it cannot be changed."""
    with open_page(view.port) as page:
        wait_for_tick(page, 1)
        for command in ({"op": "stop_robots"}, {"op": "take", "robot": 0}, {"op": "pause"}, {"op": "reset"}):
            assert page.command(**command) == "a recording is shown, which takes no commands"
    with open_page(view.port, "") as page:
        assert "may only watch" in page.command(op="replay_resume")
    assert replay.status.is_paused


def test_without_a_recording_its_commands_are_refused() -> None:
    """The page receives an empty document once."""
    with open_view(MemoryHub().bus()) as view, open_page(view.port) as page:
        page.wait(lambda: "replay" in page.docs)
        assert page.docs["replay"] is None
        assert "no replay" in page.command(op="replay_pause")


def test_nobody_asks_while_no_page_is_open(view: View, replay: FakeReplay) -> None:
    """The last page that closes ends it."""
    with open_page(view.port) as page:
        wait_for_tick(page, 1)
    wait_until_true(lambda: not view.state.viewers)
    # One look may be under way.
    pause(2 * REPLAY_PERIOD)
    looks = replay.looks
    pause(2 * REPLAY_PERIOD)
    assert replay.looks == looks > 0


def test_time_that_is_set_back_forgets_what_was_said_later() -> None:
    """But for the map, which is not said again; what has no stamp stays."""
    received = Received(lambda: None)
    for key, kind, stamp in (
        ("robot_0/plan", Path, 5 * S), ("robot_1/plan", Path, 3 * S), ("map", OccupancyGrid, 5 * S),
        ("robot_0/goal_pose", PoseStamped, 0),
    ):  # fmt: skip
        received.take(key, encode(kind(Header(time_from_ns(stamp)))))
    received.forget_after(3 * S)
    assert sorted(one.key for one in received.newest()) == ["map", "robot_0/goal_pose", "robot_1/plan"]


def test_a_page_is_sent_all_but_the_map_anew() -> None:
    """It has dropped that; scans that are gone are still taken off."""
    viewer = Viewer(1, may_command=True)
    for thing in (("map", (0, 0, 1, 1)), ("robot_0/costmap", (0, 0, 1, 1)), "robot_0/plan"):
        assert viewer.lacks(thing, 1)
    viewer.scans = {(0, 0): (1, 360)}
    viewer.forget(1)
    assert list(viewer.has) == [("map", (0, 0, 1, 1))]
    assert (viewer.era, viewer.scans) == (1, {(0, 0): None})
