"""Leases of robots, and the dead man."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from support.limits import LIMIT
from zteam.bus import Bus, MemoryHub
from zteam.messages import Twist, Vector3
from zteam.robot.wheels import Wheels
from zteam.view import driving as module
from zteam.view.driving import DEAD_MAN, Driving, Lease

AHEAD = Twist(Vector3(0.5), Vector3(z=0.1))


class Sent(Wheels):
    """Wheels that keep the commands."""

    def __init__(self) -> None:
        self.commands: list[Twist] = []
        self.presses = 0
        self.is_taken = False

    def press(self) -> None:
        """Count a key."""
        self.presses += 1

    @property
    def gives_way(self) -> bool:
        """Whether another teleop drives."""
        return self.is_taken

    def drive(self, command: Twist) -> None:
        """Keep a command."""
        self.commands.append(command)

    def close(self) -> None:
        """Nothing is open."""


@pytest.fixture
def wheels(monkeypatch: pytest.MonkeyPatch) -> Sent:
    """Those of every robot."""
    sent = Sent()
    monkeypatch.setattr(Driving, "_open", lambda _self, _robot_id: sent)
    monkeypatch.setattr(module, "PERIOD", 60.0)
    return sent


def run(story: Callable[[Driving], Awaitable[None]]) -> None:
    """What pages do."""

    async def tell(bus: Bus) -> None:
        await story(Driving(bus))

    asyncio.run(tell(MemoryHub().bus()))


@pytest.mark.usefixtures("wheels")
def test_one_viewer_drives_a_robot() -> None:
    """A second viewer is told which one drives; it gets the lease when that one gives it back."""

    async def story(driving: Driving) -> None:
        assert await driving.take(0, viewer=1) == ""
        assert await driving.take(0, viewer=1) == ""
        assert await driving.take(0, viewer=2) == "viewer 1 drives this robot"
        assert await driving.release(0, viewer=2) == "this page does not drive this robot"
        assert await driving.release(0, viewer=1) == ""
        assert (await driving.take(0, viewer=2), driving.holder(0)) == ("", 2)

    run(story)


def test_only_the_holder_commands(wheels: Sent) -> None:
    """What another viewer says changes nothing, and it is told so; when the lease ends the robot is told to stand."""

    async def story(driving: Driving) -> None:
        await driving.take(0, viewer=1)
        assert not driving.drive(0, 2, AHEAD)
        assert not driving.drive(5, 1, AHEAD)
        assert wheels.commands == [Twist()]
        assert driving.drive(0, 1, AHEAD)
        await driving.release(0, viewer=1)
        assert wheels.commands[1:] == [AHEAD, Twist()]

    run(story)


def test_a_silent_page_stops_its_robot(wheels: Sent) -> None:
    """What a page says counts until its time is over; then the robot is commanded to stand."""
    lease = Lease(1, wheels, AHEAD, heard=10.0)
    lease.send(10.0 + DEAD_MAN - 0.01)
    lease.send(10.0 + DEAD_MAN)
    assert wheels.commands == [AHEAD, Twist()]


async def until(condition: Callable[[], bool]) -> None:
    """Let the timers run."""
    for _ in range(int(LIMIT / 0.01)):
        if condition():
            return
        await asyncio.sleep(0.01)  # noqa: TID251
    raise AssertionError


def test_a_page_that_has_gone_gives_way(wheels: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    """A silent page's lease is free for another page at once, and ends by itself: its socket may end much later."""

    async def story(driving: Driving) -> None:
        monkeypatch.setattr(module, "DEAD_MAN", 0.0)
        await driving.take(0, viewer=1)
        assert (await driving.take(0, viewer=2), driving.holder(0)) == ("", 2)
        monkeypatch.setattr(module, "PERIOD", 0.001)
        monkeypatch.setattr(module, "GONE", 0.0)
        await driving.take(1, viewer=1)
        await until(lambda: driving.holder(1) is None)
        assert wheels.commands[-1] == Twist()

    run(story)


def test_a_page_gives_way_to_another_teleop(wheels: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lease is taken with a key, and so is the robot; when another key is newer, the lease ends, and the page is
    told with its next command."""
    monkeypatch.setattr(module, "PERIOD", 0.001)

    async def story(driving: Driving) -> None:
        await driving.take(0, viewer=1)
        assert wheels.presses == 1
        for command in (AHEAD, AHEAD, Twist(), AHEAD):
            assert driving.drive(0, 1, command)
        assert wheels.presses == 3
        wheels.is_taken = True
        await until(lambda: driving.holder(0) is None)
        assert not driving.drive(0, 1, AHEAD)

    run(story)


@pytest.mark.usefixtures("wheels")
def test_the_robots_of_a_page_are_released_with_it() -> None:
    """Those of other pages stay leased."""

    async def story(driving: Driving) -> None:
        for robot_id, viewer in ((0, 1), (1, 2), (2, 1)):
            await driving.take(robot_id, viewer)
        await driving.release_all(1)
        assert [driving.holder(robot_id) for robot_id in range(3)] == [None, 2, None]

    run(story)
