"""A team of all kinds of processes, and a sender that means harm: every key and every query, payload by payload."""

import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import zenoh
from hypothesis import given, seed
from hypothesis import strategies as st

from support.examples import SHARE, examples
from support.hostile import expanded, extremes, listed, payloads_of, requests
from support.web_view import open_page, open_view
from zteam import names
from zteam.bus.options import BusOptions, client_config
from zteam.bus.presence import ProcessInfo
from zteam.bus.transport import RawSample
from zteam.errors import BusError
from zteam.messages import Header, Point, Pose, PoseStamped, RobotStatus, decode, encode
from zteam.messages.message import encoding_of
from zteam.messages.topics import type_of_key
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.maps import write_map
from zteam.simulator.client import SimStatus, StepRequest
from zteam.team.testing.team import TeamFixture
from zteam.view.requests import Doc, Layer

pytestmark = pytest.mark.team

log = logging.getLogger("hostile")
TEAM = """
[team]
world = "arena"
map = "hall.yaml"
[[robots]]
id = 0
behavior = "wander"
[[robots]]
id = 1
navigation = {localizer = "fake"}
"""
PROCESSES = ["sim", "map", "tf", "monitor", "robot_0", "robot_1", "nav_1", "view"]
ROBOTS = [0, 1, 9]
"""One of them is not there."""
_SEARCH = secrets.randbits(32) if SHARE > 1.0 else 0
"""A search draws new payloads in each run."""
_CHUNK = 20
"""Payloads between two questions to all processes."""


class Sender:
    """Sends payloads to a running team, and lets the world go on between them."""

    def __init__(self, team: TeamFixture, session: zenoh.Session) -> None:
        self.team, self._session = team, session
        self.sent = 0

    def put(self, key: str, payload: bytes) -> None:
        """Publish it."""
        self._session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
        self._count()

    def ask(self, key: str, payload: bytes) -> None:
        """Ask with it. An answer may take its time, and is not waited for."""
        self._session.get(key, lambda _: None, payload=payload, timeout=5.0)
        self._count()

    def _count(self) -> None:
        self.sent += 1
        if self.sent % _CHUNK == 0:
            self.check()

    def subscribed(self) -> list[str]:
        """The keys to which the processes subscribe."""
        told = [each.key for each in self.team.bus.declarations() if not each.publishes]
        return [key for key_expr in told for key in names.keys_in(key_expr, ROBOTS) if type_of_key(key)]

    def check(self) -> None:
        """All processes answer."""
        step = StepRequest(ticks=1, wait=False)
        with suppress(BusError):
            self.team.bus.query(names.service_key(names.SIMULATOR, "step"), SimStatus, step, timeout=20.0)
        told = [info.name for _, info in self.team.bus.query(names.info_key("*"), ProcessInfo, timeout=20.0)]
        assert {*told} >= {*PROCESSES}, told

    def restores(self) -> bool:
        """Whether the world could be put back to its start, at rest."""
        try:
            self.team.sim.set_speed(None)
            self.team.sim.pause()
            self.team.sim.reset()
            self.team.release()
        except BusError as error:
            log.info("%s", error)
            return False
        return True


@pytest.fixture
def sender(team: TeamFixture, tmp_path: Path) -> Iterator[Sender]:
    """The sender, and its running team."""
    write_map(make_map(np.zeros((200, 200), np.int8), 0.05), tmp_path / "hall.yaml")
    path = tmp_path / "team.toml"
    path.write_text(TEAM)
    team.launch(path)
    team.spawn("zteam-view", "--port", "0", "--no-browser", "--name", names.VIEW, name=names.VIEW)
    team.wait_for_processes(*PROCESSES)
    team.wait_for_go()
    session = zenoh.open(client_config(BusOptions(connect=team.endpoint, namespace=team.namespace)))
    yield Sender(team, session)
    session.close()  # type: ignore[no-untyped-call]


def flood(act: Callable[[str, bytes], None], key: str, payloads: st.SearchStrategy[bytes], number: int) -> None:
    """Some payloads on one key; `number` chooses them."""
    drawn = list[bytes]()

    @seed(number + _SEARCH)
    @examples(3)
    @given(payloads)
    def draw(payload: bytes) -> None:
        drawn.append(payload)

    draw()
    # The first one that hypothesis draws is always the simplest.
    for payload in drawn[1:]:
        act(key, payload)


CALM = """
[team]
world = "arena"
[[robots]]
id = 0
behavior = "wander"
[[robots]]
id = 1
follow = 0
[[robots]]
id = 2
follow = 1
model = "erratic"
pose = [-3.5, 1.5, 0.0]
[[robots]]
id = 3
model = "erratic"
pose = [3.0, -3.0, 1.0]
navigation = {localizer = "fake"}
[[robots]]
id = 4
model = "erratic"
pose = [3.0, 3.0, 1.0]
behavior = "go_to"
"""
NODES = ["sim", "tf", "monitor", "robot_1", "nav_3"]
"""Whose own keys get extreme values, besides those of ROBOTS."""


class Calm:
    """A team of all kinds of nodes in this process, in lock-step, and a page that looks at everything."""

    def __init__(self, folder: Path) -> None:
        self.team, self._ends = TeamFixture(), ExitStack()
        self._ends.callback(self.team.close)
        (folder / "team.toml").write_text(CALM)
        self.team.launch(folder / "team.toml", in_process=True)
        self.team.wait_for_go()
        self.page = self._ends.enter_context(open_page(self._ends.enter_context(open_view(self.team.bus)).port))
        self.page.say(op="look", layers=get_args(Layer), docs=get_args(Doc), beams=90, selected=[0, 1, 2, 3, 4])
        self.heard: dict[str, RawSample] = {}
        self.team.bus.subscribe_raw("**", lambda sample: self.heard.setdefault(sample.key, sample), latched=True)
        self.give_goals()
        self.team.run(2.5)

    def give_goals(self) -> None:
        """Robots 3 and 4 are on their way."""
        for robot_id in (3, 4):
            goal = PoseStamped(Header(frame_id=names.MAP_FRAME), Pose(Point(-2.0, -2.0)))
            self.team.bus.publisher(names.robot_key(robot_id, names.GOAL_POSE), PoseStamped).put(goal)

    def send_extremes(self, key: str) -> None:
        """All that a message of the key may hold, one a tick; then the true one again, and the world at its start."""
        kind, true = type_of_key(key), self.heard.get(key)
        assert kind is not None
        publisher = self.team.bus.transport.declare_publisher(key, encoding_of(kind), False)
        for message in extremes(kind() if true is None else decode(kind, true.payload)):
            publisher.put(encode(message))
            self.team.run(0.1)
        if true is not None:
            publisher.put(true.payload)
        publisher.close()
        self.team.sim.reset()
        self.give_goals()
        self.team.run(0.3)
        frames = len(self.page.frames)
        self.page.wait(lambda: len(self.page.frames) > frames)

    def close(self) -> None:
        """End it."""
        self._ends.close()


@pytest.fixture
def calm(tmp_path: Path) -> Iterator[Calm]:
    """The team."""
    made = Calm(tmp_path)
    yield made
    made.close()


@pytest.mark.ci
@pytest.mark.parametrize("robot_id", [0, 1, 3, 4, None])
def test_no_number_in_a_message_ends_a_process(
    calm: Calm, caplog: pytest.LogCaptureFixture, robot_id: int | None
) -> None:
    """Each field of each type on the keys of a robot, or of the team, is sent at each of its extremes: all nodes live,
    no callback fails, and afterwards the line drives as before. What the robots publish stays within bounds."""
    told: list[RobotStatus] = []
    robots = [] if robot_id is None else [robot_id]
    for key in expanded(listed("Keys"), [] if robots else NODES, robots):
        if robots or not key.startswith("robot_$"):
            calm.send_extremes(key)
    assert not [record for record in caplog.records if record.exc_info]
    # Not `team.robot`: what it saw of the robots was forged as well.
    before = [robot.distance_m for robot in calm.team.report.robots[:3]]
    calm.team.bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, lambda _, status: told.append(status))
    calm.team.run(20.0)
    assert all(robot.distance_m > before[robot.id] + 0.3 for robot in calm.team.report.robots[:3])
    assert told
    assert all(0.0 <= status.gap <= 100.0 and -1 <= status.turns < 100 and abs(status.speed) < 2.0 for status in told)


def test_hostile_payloads_do_no_harm(sender: Sender) -> None:
    """On every key and query: all processes live and answer, and the robots still drive."""
    team = sender.team
    keys = expanded([*listed("Keys"), *sender.subscribed()], PROCESSES, ROBOTS)
    queries = [*expanded(listed("Queries"), [*PROCESSES, names.LAUNCHER], ROBOTS), "**"]
    floods = [(sender.put, key, payloads_of(key)) for key in keys] + [(sender.ask, key, requests()) for key in queries]
    for number, flood_of_key in enumerate(floods):
        flood(*flood_of_key, number)
    log.info("%d payloads, drawn from %d", sender.sent, _SEARCH)
    sender.check()
    team.wait_for(sender.restores)
    # Not `team.robot`: what it saw of the robots was forged as well.
    team.until(lambda: team.report.robots[0].distance_m > 0.5, within=20)
