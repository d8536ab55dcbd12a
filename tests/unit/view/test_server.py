"""The web server on a bus in memory: what it serves, what it refuses, and what no page can do to another one."""

import gzip
import threading
from collections.abc import Iterator
from functools import partial
from urllib.request import Request, urlopen

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

from support.limits import LIMIT
from support.log_capture import captured_log
from support.transports import wait_until_true
from support.web_view import TOKEN, View, open_page, open_view
from zteam import names
from zteam.bus import Bus, Change, MemoryHub, NoRequest
from zteam.clock import monotonic
from zteam.errors import BusError
from zteam.messages import (
    BaseInfo,
    Header,
    LaserScan,
    Log,
    Odometry,
    Path,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Twist,
    Vector3,
)
from zteam.node.stopping import StopSwitch
from zteam.robot.client import CANCEL, CancelReply, CancelRequest, ListReply, navigation_query
from zteam.view.frames import PATH, POSES, SAMPLES, TEAM
from zteam.view.requests import MAX_BYTES


@pytest.fixture
def memory() -> MemoryHub:
    """A bus in memory."""
    return MemoryHub()


@pytest.fixture
def bus(memory: MemoryHub) -> Bus:
    """A session beside the view's."""
    return memory.bus()


@pytest.fixture
def view(memory: MemoryHub) -> Iterator[View]:
    """A view of the bus."""
    with open_view(memory.bus(), b'{"theme":"dark"}') as view:
        yield view


def subscribed(bus: Bus) -> set[str]:
    """What all other sessions subscribe to."""
    return {declaration.key for declaration in bus.declarations() if not declaration.publishes}


def test_every_answer_has_the_policy(view: View) -> None:
    """Scripts of the page alone may run, nothing is guessed, and a browser asks again for what it has."""
    for path in ("/", "/layout.json", "/page/js/main.js", "/page/style.css"):
        response = view.get(path)
        assert (response.status, response.getheader("cache-control")) == (200, "no-cache")
        assert "default-src 'self'" in (response.getheader("content-security-policy") or "")
        assert response.getheader("x-content-type-options") == "nosniff"


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        *(("GET", path, 404) for path in ("/page/../server.py", "/page/%2e%2e/server.py", "/page/none.js", "/ws")),
        *((method, "/", 405) for method in ("POST", "PUT", "DELETE")),
    ],
)
def test_only_the_pages_files_are_served(view: View, method: str, path: str, status: int) -> None:
    """Anything else is not found, and nothing is commanded over HTTP."""
    assert view.get(path, method=method).status == status


def test_a_foreign_name_in_host_is_refused(view: View) -> None:
    """A site that leads its own name here gets nothing."""
    assert view.get("/", host=f"evil.example:{view.port}").status == 421
    long = view.get("/", host="x" * 5000)
    assert (long.status, long.getheader("content-length")) == (421, str(len("this server is not known as ") + 80))


def test_without_a_layout_there_is_no_content(memory: MemoryHub) -> None:
    """The page then begins with its own; an error would show up in the browser's console."""
    with open_view(memory.bus()) as view:
        assert view.get("/layout.json").status == 204


def test_a_socket_from_another_origin_gets_403(view: View) -> None:
    """A page of another site cannot open it, though the browser would send it to this machine; one line says so."""
    with open_page(view.port, Origin=f"http://127.0.0.1:{view.port}") as page:
        assert page.welcome["version"] == 1
    origin = "http://evil.example"
    with captured_log() as log, pytest.raises(InvalidStatus, match="403"), open_page(view.port, Origin=origin):
        pass
    assert len(log.lines) == 1


def test_the_page_is_sent_in_few_bytes(view: View) -> None:
    """A browser that takes gzip gets the page's files so; the map comes as one script, without the panels."""
    site = f"http://127.0.0.1:{view.port}"
    name = "/page/js/main.js"
    with urlopen(Request(site + name, headers={"Accept-Encoding": "gzip"})) as packed, urlopen(site + name) as plain:
        content, short = plain.read(), packed.read()
    assert gzip.decompress(short) == content and len(short) < len(content) / 3
    assert b'modules["js/scene/scene.js"]' in content and b'modules["js/panels/' not in content


def test_a_robot_that_cannot_give_its_goal_up_holds_no_other(view: View, memory: MemoryHub) -> None:
    """The others stop, and the page is told of that one."""
    asked: list[int] = []

    def refuse(_request: CancelRequest) -> CancelReply:
        raise BusError("it hangs")

    def stop(_request: CancelRequest) -> CancelReply:
        asked.append(1)
        return CancelReply(canceled=True)

    for robot_id, answer in enumerate((refuse, stop)):
        memory.bus().serve(navigation_query(robot_id, CANCEL), CancelRequest, answer)
    with open_page(view.port) as page:
        said = page.command(op="cancel", robots=[0, 1, 2])
    assert "it hangs" in said and "nothing that takes goals answers for robot_2" in said and "robot_1" not in said
    assert asked == [1]


def test_a_page_that_watches_stops_and_does_not_release(view: View, memory: MemoryHub) -> None:
    """The stop waits for no other command, and is told by which processes it is not confirmed."""
    asked, going = threading.Event(), threading.Event()

    def hang(_request: CancelRequest) -> CancelReply:
        asked.set()
        going.wait(LIMIT)
        return CancelReply(canceled=True)

    switch = StopSwitch(memory.bus(), 0)
    memory.bus().serve(navigation_query(0, CANCEL), CancelRequest, hang)
    bus = memory.bus()
    with open_page(view.port) as page, open_page(view.port, token="another") as watcher:
        bus.declare_token("robot_0/alive/a")
        page.say(op="cancel", robots=[0], seq=1)
        assert asked.wait(LIMIT)
        for pressing in (page, watcher):
            pressing.say(op="stop_robots", seq=7)
            pressing.wait(lambda pressing=pressing: pressing.replies.get(7) == "")  # type: ignore[misc]
            assert switch.is_stopped
        assert 1 not in page.replies
        going.set()
        assert "may only watch" in watcher.command(op="release_robots")
        assert switch.is_stopped
        page.say(op="release_robots", seq=8)
        page.wait(lambda: page.replies.get(8) == "")
        assert not switch.is_stopped
        bus.declare_token("base_3/alive/a")
        page.say(op="stop_robots", seq=9)
        page.wait(lambda: 9 in page.replies)
        assert page.replies[9].startswith("robot_3: nothing holds it")


def test_cancel_all_pauses_lists_of_goals(view: View, memory: MemoryHub) -> None:
    """All lists, before the goals are given up, also one that the page has not seen; a single cancel pauses none."""
    told: list[object] = []

    def cancel(robot_id: int, _request: CancelRequest) -> CancelReply:
        told.append(robot_id)
        return CancelReply(canceled=robot_id == 0)

    def pause(robot_id: int, paused: bool, _request: Change) -> ListReply:
        told.append((robot_id, paused))
        return ListReply(paused)

    for robot_id in (0, 1):
        memory.bus().serve(navigation_query(robot_id, CANCEL), CancelRequest, partial(cancel, robot_id))
        memory.bus().serve(names.robot_key(robot_id, names.GOALS), NoRequest, lambda _: ListReply(False))
        for topic, paused in ((names.PAUSE_GOALS, True), (names.RESUME_GOALS, False)):
            memory.bus().serve(names.robot_key(robot_id, topic), Change, partial(pause, robot_id, paused))
    with open_page(view.port) as page:
        assert page.command(op="cancel", robots=[0]) == ""
        assert page.command(op="cancel", robots=[0], pauses=True) == ""
        assert page.command(op="resume_lists") == ""
    assert told[:3] == [0, (0, True), (1, True)]
    assert {*told[3:5]} == {0, 1}
    assert told[5:] == [(0, False), (1, False)]


def test_the_token_gives_the_right_to_command(view: View) -> None:
    """Without it a page watches, and is told so when it commands."""
    with open_page(view.port) as page, open_page(view.port, token="another") as watcher:
        assert (page.welcome["may_command"], watcher.welcome["may_command"]) == (True, False)
        assert "may only watch" in watcher.command(op="pause")
        assert "no simulator is there" in page.command(op="pause")
        assert "may only watch" in watcher.command(op="take", robot=0)
        watcher.say(op="token", token=TOKEN)
        assert "no simulator is there" in watcher.command(op="pause")


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ('{"op":"ack","frame":0}', "hello"),
        ('{"op":"hello","version":2}', "version 2"),
        ("{", "truncated"),
        (b"{}", "text"),
    ],
)
def test_a_wrong_first_message_closes_the_socket_with_a_reason(view: View, message: str | bytes, reason: str) -> None:
    """Code 1008, and the reason also comes as a text."""
    with open_page(view.port, hello=False) as page:
        page.say_raw(message)
        code, said = page.end()
        assert code == 1008
        assert reason in said
        assert reason in page.refused


def test_a_later_message_that_is_not_understood_closes_the_socket(view: View) -> None:
    """Nor is one above 64 KiB read. The other pages go on."""
    with open_page(view.port) as other:
        with open_page(view.port) as page:
            page.say(op="fly")
            assert page.end()[0] == 1008
        with open_page(view.port) as page:
            page.say_raw('{"op":"token","token":"' + "x" * MAX_BYTES + '"}')
            assert page.end()[0] in (1008, 1009)
        other.wait(lambda: other.docs.get("team", {}).get("viewers") == 1)


@pytest.mark.ci
def test_a_page_that_floods_is_read_later_and_keeps_no_other_away(view: View) -> None:
    """Of 600 messages 200 are read at once, and then 100 a second. Meanwhile another page has its answer and frames."""
    with open_page(view.port) as other, open_page(view.port, acknowledges=False) as flood:
        begin = monotonic()
        for _ in range(600):
            flood.say(op="ack", frame=0)
        flood.say(op="pause", seq=1)
        assert "no simulator is there" in other.command(op="pause")
        frames = len(other.frames)
        other.wait(lambda: len(other.frames) >= frames + 3)
        flood.wait(lambda: 1 in flood.replies)
        assert monotonic() - begin > 3.9


def test_a_page_that_may_only_watch_sees_the_doctor_and_cannot_call_it(view: View) -> None:
    """The document comes to each page that shows it; only one with the token may have it made anew."""
    with open_page(view.port, token="another") as watcher:
        watcher.say(op="look", docs=["doctor"])
        # The first document may come before anything has been found.
        watcher.wait(lambda: "one process" in watcher.docs.get("doctor", {}).get("error", ""))
        assert "may only watch" in watcher.command(op="doctor")


@pytest.mark.gate
def test_nothing_is_subscribed_to_while_nobody_watches(view: View, bus: Bus) -> None:
    """Subscriptions come with the first page and go with the last one."""
    assert subscribed(bus) == set()
    with open_page(view.port) as page:
        page.wait(lambda: "team_status" in subscribed(bus))
        assert not any("base_scan" in key or "goal_pose" in key or key.endswith("/log") for key in subscribed(bus))
        page.say(op="look", layers=["goals"], docs=["log"])
        page.wait(lambda: {"robot_$*/goal_pose", "*/log"} <= subscribed(bus))
        page.say(op="watch", topic="robot_0/odom", field="")
        page.wait(lambda: "robot_0/odom" in subscribed(bus))
        page.say(op="unwatch", topic="robot_0/odom", field="")
        page.say(op="look", layers=[])
        page.wait(lambda: not {"robot_0/odom", "*/log"} & subscribed(bus))
    wait_until_true(lambda: not subscribed(bus))


def put_robot(bus: Bus) -> None:
    """A robot without transforms: its ground truth and its base."""
    bus.publisher("robot_0/base_info", BaseInfo, latched=True).put(BaseInfo(model="small"))
    pose = PoseWithCovariance(Pose(Point(2.0, 3.0)))
    bus.publisher("robot_0/base_pose_ground_truth", Odometry).put(Odometry(Header(frame_id="map"), pose=pose))


def test_without_transforms_poses_are_the_ground_truth(view: View, bus: Bus) -> None:
    """The robot is where the simulator says, and its model is known."""
    with open_page(view.port) as page:
        page.wait(lambda: "robot_$*/base_pose_ground_truth" in subscribed(bus))
        put_robot(bus)
        page.wait(lambda: (POSES, TEAM) in page.blocks)
        assert np.frombuffer(page.blocks[POSES, TEAM][:8], "<f4").tolist() == [2.0, 3.0]
        page.wait(lambda: [r["model"] for r in page.docs["team"]["robots"]] == ["small"])


@pytest.mark.gate
def test_a_path_on_any_key_is_drawn(view: View, bus: Bus) -> None:
    """The key's type is learnt from its first message; a key of another type is not subscribed to for long."""
    path = bus.publisher("my/way", Path)
    text = bus.publisher("my/log", Log)
    with open_page(view.port) as page:
        page.say(op="look", layers=["plans"])
        page.wait(lambda: {"my/way"} <= subscribed(bus))
        message = Path(Header(frame_id="map"), [PoseStamped(pose=Pose(Point(1.0, 2.0))), PoseStamped()])

        def drawn() -> bool:
            path.put(message)
            text.put(Log())
            return (PATH, TEAM) in page.blocks

        page.wait(drawn)
        assert np.frombuffer(page.blocks[PATH, TEAM][-16:], "<f4").tolist() == [1.0, 2.0, 0.0, 0.0]
        assert "my/log" not in subscribed(bus)


def test_each_value_of_a_plotted_field_comes(view: View, bus: Bus) -> None:
    """No sample is lost, however few frames are sent."""
    command = bus.publisher("robot_0/cmd_vel", Twist)
    with open_page(view.port) as page:
        page.say(op="watch", topic="robot_0/cmd_vel", field="linear.x")
        page.wait(lambda: command.has_subscribers)
        for number in range(50):
            command.put(Twist(Vector3(float(number))))
        values: list[float] = []

        def collect() -> bool:
            body = page.blocks.pop((SAMPLES, TEAM), None)
            if body is not None:
                begin = -(-(2 + int.from_bytes(body[:2], "little")) // 8) * 8
                values.extend(np.frombuffer(body[begin:], "<f8").reshape(-1, 2)[:, 1].tolist())
            return len(values) >= 50

        page.wait(collect)
        assert values == [float(number) for number in range(50)]


def test_the_newest_message_is_echoed(view: View, bus: Bus) -> None:
    """As JSON under ROS's names of the fields."""
    scan = bus.publisher("robot_0/base_scan", LaserScan)
    with open_page(view.port) as page:
        page.say(op="watch", topic="robot_0/base_scan", field="")
        page.wait(lambda: scan.has_subscribers)
        scan.put(LaserScan(range_max=8.0))
        page.wait(lambda: "echo" in page.docs)
        assert page.docs["echo"]["json"]["range_max"] == 8.0


@pytest.mark.gate
def test_a_page_that_takes_no_frame_is_sent_no_third_one(view: View) -> None:
    """Its credit is two frames; another page goes on meanwhile."""
    with open_page(view.port, acknowledges=False) as still, open_page(view.port) as page:
        still.wait(lambda: len(still.frames) == 2)
        frames = len(page.frames)
        page.wait(lambda: len(page.frames) >= frames + 3)
        still.command(op="pause")
        assert len(still.frames) == 2
