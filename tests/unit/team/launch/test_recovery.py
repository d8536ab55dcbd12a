"""When a process that is started again is back, and how long that took."""

import pytest

from support.cuttable_transport import cut_bus
from support.log_capture import captured_log
from zteam import names
from zteam.bus.memory import MemoryHub
from zteam.messages import RobotState, RobotStatus
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Restarted, restarts_text
from zteam.team.launch import progress
from zteam.team.launch.progress import Recoveries


class Watched:
    """Recoveries in a team whose processes, link and host clock are the test's."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr(progress, "monotonic", lambda: self.now)
        self.counts: dict[str, int] = {}
        hub = MemoryHub()
        bus, self.link = cut_bus(hub)
        self.recoveries = Recoveries(TeamObserver(bus), lambda: self.counts)
        self._others = hub

    def fail(self, name: str) -> None:
        """The process fails now, and is started again."""
        self.counts[name] = self.counts.get(name, 0) + 1
        self.recoveries.note_failure(name)

    def come(self, name: str, after: float) -> None:
        """Its token comes `after` host seconds."""
        self.now += after
        bus = self._others.bus()
        bus.declare_token(names.token_key(name, bus.instance))

    def say(self, name: str, *, is_ready: bool) -> None:
        """A robot publishes its status."""
        robot_id = names.robot_id_of(name)
        assert robot_id is not None
        publisher = self._others.bus().publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
        publisher.put(RobotStatus(robot_id=robot_id, is_ready=is_ready, state=RobotState.RUNNING))


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Watched:
    """A team in which nothing has failed yet."""
    return Watched(monkeypatch)


def test_a_process_is_back_with_its_token(watched: Watched) -> None:
    """It is told once; the longest time is kept; a process that never failed is not told of."""
    with captured_log() as log:
        watched.come(names.MONITOR, 0.0)
        for after in (0.25, 1.25, 0.5):
            watched.fail(names.AGGREGATOR)
            watched.come(names.AGGREGATOR, after)
        watched.come(names.AGGREGATOR, 5.0)
    assert log.lines == ["tf is back after 0.2 s", "tf is back after 1.2 s", "tf is back after 0.5 s"]
    assert watched.recoveries.restarted() == {names.AGGREGATOR: Restarted(3, 1.25)}


def test_a_robot_is_back_when_it_is_ready(watched: Watched) -> None:
    """Not with its token, and not with what its dead process has sent before."""
    watched.fail("robot_1")
    watched.say("robot_1", is_ready=True)
    watched.come("robot_1", 0.25)
    watched.say("robot_1", is_ready=False)
    assert watched.recoveries.restarted() == {"robot_1": Restarted(1)}
    watched.now += 0.5
    watched.say("robot_1", is_ready=True)
    assert watched.recoveries.seconds == {"robot_1": 0.75}


def test_a_process_that_fails_before_it_is_back_is_away_from_the_first_failure_on(watched: Watched) -> None:
    """The user waits for it all that time."""
    for _ in range(2):
        watched.fail("robot_1")
        watched.come("robot_1", 1.0)
    watched.say("robot_1", is_ready=True)
    assert watched.recoveries.seconds == {"robot_1": 2.0}


def test_the_router_is_back_with_the_link(watched: Watched) -> None:
    """A link that is lost and back while the router lives is no recovery of it."""
    watched.link.set_link(False)
    watched.link.set_link(True)
    watched.fail(ROUTER)
    watched.now += 0.5
    watched.link.set_link(True)
    assert watched.recoveries.restarted() == {ROUTER: Restarted(1, 0.5)}


def test_another_simulator_is_told_with_what_it_means(watched: Watched) -> None:
    """The world is not where it was."""
    watched.fail(names.SIMULATOR)
    with captured_log() as log:
        watched.come(names.SIMULATOR, 0.5)
    assert log.lines == ["sim is back after 0.5 s: the world stands at its start again"]


def test_restarts_are_told_in_one_line() -> None:
    """With the time that each was away, if it came back; nothing without any."""
    assert restarts_text({}) == ""
    text = restarts_text({"tf": Restarted(2, 1.25), "camera": Restarted(1)})
    assert text == "started again: camera 1 time, tf 2 times (back after 1.2 s)"
