"""The router on demand: on a port of the test's own, never the machine's default one."""

import os
import random
import select
import signal
import socket
import subprocess
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from support.freezing import freeze
from support.limits import LIMIT
from support.transports import wait_until_true
from support.web_view import TOKEN, open_page
from zteam import names
from zteam.bus import Bus, BusOptions, connect, connection, router
from zteam.bus.options import LEASE, RouterOptions, port_accepts
from zteam.bus.router import RouterMetadata, open_team_router, read_admin, router_log_path, spawn_router
from zteam.clock import HOST_FACTOR, monotonic, pause
from zteam.errors import BusError
from zteam.messages import Bool
from zteam.team.launch.supervisor import Supervisor
from zteam.view.frames import GRID, SCAN, TEAM

pytestmark = pytest.mark.team


@pytest.fixture
def endpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A free port in place of the default one. A router there ends a second after its last client, or with the test."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(router, "IDLE_EXIT", HOST_FACTOR)
    while True:
        # Outside the range of ephemeral ports.
        port = random.randint(21000, 31000)
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                break
    chosen = f"tcp/127.0.0.1:{port}"
    monkeypatch.setattr("zteam.bus.options.DEFAULT_ENDPOINT", chosen)
    yield chosen
    info = router_metadata(chosen)
    if info is not None and info.pid is not None:
        wait_for_end(info.pid)


def router_metadata(endpoint: str) -> RouterMetadata | None:
    """What the router at `endpoint` says of its process; None if there is none."""
    record = read_admin(BusOptions(connect=endpoint))
    return record.metadata if record else None


def wait_for_end(pid: int) -> None:
    """Wait until a process that is no child of this one has ended."""
    try:
        handle = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    readable, _, _ = select.select([handle], [], [], LIMIT)  # noqa: TID251
    if not readable:
        signal.pidfd_send_signal(handle, signal.SIGKILL)
    os.close(handle)
    assert readable, "the router did not end by itself"


def router_pid(endpoint: str) -> int:
    """Process id of the router at `endpoint`."""
    info = router_metadata(endpoint)
    assert info is not None
    assert info.pid is not None
    return info.pid


def wait_for_router(endpoint: str) -> None:
    """Wait until a command that has just begun has a session at its router."""
    wait_until_true(
        lambda: (record := read_admin(BusOptions(connect=endpoint))) is not None and len(record.sessions) > 1
    )


ENDING = """
from zteam.bus import options, router
options.DEFAULT_ENDPOINT, router.IDLE_EXIT = {!r}, 1.0
from zteam.bus import BusOptions, connect
from zteam.messages import Bool
bus = connect(BusOptions())
bus.subscribe("flag", Bool, print)
{}
"""


@pytest.mark.parametrize(("last", "code"), [("", 0), ("1 / 0", 1)])
def test_a_script_that_does_not_close_ends(endpoint: str, last: str, code: int) -> None:
    """A script without `bus.close()` ends with its own exit code."""
    script = ENDING.format(endpoint, last)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == code, done.stderr


class Listener:
    """Counts the messages on one key."""

    def __init__(self, bus: Bus, key: str) -> None:
        self._arrived = threading.Condition()
        self.count = 0
        bus.subscribe(key, Bool, self._take)

    def _take(self, _key: str, _message: Bool) -> None:
        with self._arrived:
            self.count += 1
            self._arrived.notify_all()

    def hears(self, send: Callable[[], None]) -> bool:
        """Whether a message arrives while `send` is called repeatedly."""
        with self._arrived:
            start = self.count
            for _ in range(int(LIMIT / 0.02)):
                send()
                if self._arrived.wait_for(lambda: self.count > start, 0.02):
                    return True
        return False


def test_the_first_client_starts_it_and_the_others_join(endpoint: str) -> None:
    """Both clients use one router, which runs in a session of its own."""
    first = connect(BusOptions())
    second = connect(BusOptions())
    try:
        pid = router_pid(endpoint)
        assert os.getsid(pid) != os.getsid(0)
        listener, publisher = Listener(second, "a"), first.publisher("a", Bool)
        assert listener.hears(lambda: publisher.put(Bool(True)))
    finally:
        first.close()
        second.close()


def test_it_ends_when_its_last_client_has_gone(endpoint: str) -> None:
    """It lives as long as it is used, and its log says why it ended."""
    bus = connect(BusOptions())
    pid = router_pid(endpoint)
    bus.close()
    wait_for_end(pid)
    assert "the router ends" in router_log_path(endpoint).read_text()
    assert router_metadata(endpoint) is None


@pytest.mark.parametrize("looks", [0, 4])
def test_a_router_that_dies_is_started_again(endpoint: str, looks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both clients reconnect, and their subscribers and publishers work again; also where another router has the port
    for some looks, and ends before they have connected to it."""
    held = iter([True] * looks)
    first, second = connect(BusOptions()), connect(BusOptions())
    try:
        listener, publisher = Listener(second, "a"), first.publisher("a", Bool)
        assert listener.hears(lambda: publisher.put(Bool(True)))
        pid = router_pid(endpoint)
        monkeypatch.setattr(connection, "port_accepts", lambda place: next(held, False) or port_accepts(place))
        os.kill(pid, signal.SIGKILL)
        wait_for_end(pid)
        assert listener.hears(lambda: publisher.put(Bool(True)))
        assert router_pid(endpoint) != pid
    finally:
        first.close()
        second.close()


def test_processes_that_start_at_once_share_a_router(endpoint: str) -> None:
    """Six processes start at once: one router gets the port, and all six connect to it."""
    code = (
        "import zteam.bus.options, sys\n"
        "from zteam.bus import BusOptions, connect, router\n"
        f"zteam.bus.options.DEFAULT_ENDPOINT = {endpoint!r}\n"
        "router.IDLE_EXIT = 1.0\n"
        "bus = connect(BusOptions())\n"
        "print(*bus.transport._session.info.routers_zid(), flush=True)\n"
        "sys.stdin.read()\n"
        "bus.close()"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(6)
    ]
    try:
        routers = {each.stdout.readline() for each in started if each.stdout}
        assert len(routers) == 1
        assert routers != {""}
    finally:
        for each in started:
            each.communicate(timeout=LIMIT)
    assert [each.returncode for each in started] == [0] * 6


def test_a_router_on_demand_has_the_lease_of_the_process_that_starts_it(endpoint: str) -> None:
    """Frozen for longer than the usual lease, it keeps the link to a process that asked for a longer one."""
    changes: list[bool] = []
    bus = connect(BusOptions(lease=15.0))
    try:
        bus.watch_link(changes.append)
        freeze([router_pid(endpoint)], LEASE + 0.5)
        # The router answers, and the link is the old one.
        assert bus.declarations() == []
        assert changes == []
    finally:
        bus.close()


def test_a_router_that_finds_its_port_taken_ends_quietly(endpoint: str) -> None:
    """The loser of the race leaves no process, and its line is in the log, not on a screen."""
    bus = connect(BusOptions())
    try:
        spawn_router(endpoint)
        pid = router_pid(endpoint)
        log = router_log_path(endpoint)
        end = monotonic() + LIMIT
        while "in use" not in log.read_text() and monotonic() < end:
            pause(0.01)
        assert "in use" in log.read_text()
        assert router_pid(endpoint) == pid
    finally:
        bus.close()


def test_another_users_router_is_not_joined(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a shared machine two users' teams must not mix by accident; with --connect they may."""
    bus, owner = connect(BusOptions()), os.getuid()
    try:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
        with pytest.raises(BusError, match=rf"belongs to user id {owner}:.*--connect"):
            connect(BusOptions())
        connect(BusOptions(connect=endpoint)).close()
    finally:
        bus.close()


@pytest.mark.parametrize("held", ["idle", "a client", "another user's"])
def test_a_team_gets_the_port_of_the_users_own_router(
    endpoint: str, held: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A router on demand ends at once, with or without a client; another user's stays and keeps the port."""
    monkeypatch.setattr(router, "IDLE_EXIT", 2 * LIMIT)
    bus = connect(BusOptions())
    pid = router_pid(endpoint)
    if held == "idle":
        bus.close()
    with monkeypatch.context() as patched:
        if held == "another user's":
            patched.setattr(os, "getuid", lambda: 12345)
            with closing(open_team_router(RouterOptions((endpoint,)))) as team:
                assert team.endpoint != endpoint
                assert router_pid(endpoint) == pid
    with closing(open_team_router(RouterOptions((endpoint,)))) as team:
        assert team.endpoint == endpoint
        wait_for_end(pid)
    bus.close()


def test_with_connect_nothing_is_started(endpoint: str) -> None:
    """--connect waits as long as it was told to, then says how to go on; no router appears."""
    with pytest.raises(BusError, match="zteam-router --listen"):
        connect(BusOptions(connect=endpoint), patience=0.2)
    assert router_metadata(endpoint) is None
    assert not router_log_path(endpoint).exists()


AS_DEFAULT = """
import runpy, sys
from zteam.bus import options, router
options.DEFAULT_ENDPOINT, router.IDLE_EXIT = sys.argv[1], 1.0
sys.argv = sys.argv[2:]
(runpy.run_path if sys.argv[0].endswith(".py") else runpy.run_module)(sys.argv[0], run_name="__main__")
"""


class Terminals:
    """Commands that a user has open, each in a terminal of its own. The default port is the test's."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint = endpoint
        self.said = defaultdict[str, list[str]](list)
        """Lines by command."""
        self._supervisor = Supervisor(lambda name, line: self.said[name].append(line), lambda _member, _again: None)

    def run(self, name: str, program: str, *words: str, **environment: str) -> None:
        """Start a module or a file; its lines begin anew."""
        self.said[name] = []
        command = [sys.executable, "-P", "-c", AS_DEFAULT, self._endpoint, program, *words]
        self._supervisor.start(name, command, environment)

    def start_team(self, team: str = "arena") -> None:
        """`zteam up`, until two robots drive."""
        self.run("up", "zteam", "up", team)
        self.wait(lambda: sum("GO: driving" in line for line in list(self.said["up"])) >= 2)

    def wait_for(self, name: str, text: str) -> str:
        """The first line of a command with this text."""
        self.wait(lambda: any(text in line for line in list(self.said[name])))
        return next(line for line in self.said[name] if text in line)

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()`, which is looked at with each line."""
        assert self._supervisor.wait(condition, LIMIT), "\n".join(
            f"{name}: {line}" for name, lines in self.said.items() for line in lines
        )

    def stop(self, *names: str) -> None:
        """Ctrl+C in these terminals."""
        self._supervisor.stop(names)

    def close(self) -> None:
        """End all commands."""
        self._supervisor.close()


@pytest.fixture
def terminals(endpoint: str) -> Iterator[Terminals]:
    """What is open ends with the test."""
    with closing(Terminals(endpoint)) as terminals:
        yield terminals


NODE = """
from zteam import run
from zteam.messages import OccupancyGrid, Odometry, TFMessage

def main(node):
    node.on_time_reset(lambda: print("reset"))
    node.subscribe("robot_0/odom", Odometry, lambda *_: print("odom"), every_tick=True)
    node.subscribe("map", OccupancyGrid, lambda *_: print("map"), latched=True)
    node.subscribe("tf_static", TFMessage, lambda *_: print("tf_static"), latched=True)
    node.run(lambda now: print("step"))

run("crowd", main)
"""


TEAMS = ("arena", "line")
"""One after the other: of two robots and of four, in another world."""


def node_meets(lines: list[str], is_first: bool) -> bool:
    """It gets latched messages. From the jump back of time on it gets the others, and its step is called."""
    new = lines if is_first else lines[lines.index("reset") :] if "reset" in lines else []
    return {"map", "tf_static"} <= set(lines) and {"odom", "step"} <= set(new)


def echo_meets(lines: list[str], is_first: bool) -> bool:
    """It prints what only the second team has."""
    return any('"frame_id":"robot_3/odom"' in line for line in lines) or (is_first and "{" in "".join(lines))


def log_meets(lines: list[str], is_first: bool) -> bool:
    """It prints a line that comes at the end of the team's start."""
    return any(f"[robot_{1 if is_first else 3}] GO: driving" in line for line in lines)


def monitor_meets(lines: list[str], is_first: bool) -> bool:
    """It gives GO, which holds for later teams too; then it shows a further robot."""
    return "All robots GO!" in lines if is_first else any(line.startswith("robot_3 ") for line in lines)


LEFT_OPEN = {
    "node": (("crowd.py",), node_meets),
    "topic echo": (("zteam", "topic", "echo", "robot_$*/odom", "--json"), echo_meets),
    "log": (("zteam", "log"), log_meets),
    "monitor": (("zteam", "zteam-monitor", "--team-size", "2"), monitor_meets),
}


@pytest.mark.parametrize("left_open", LEFT_OPEN)
def test_what_is_left_open_meets_each_team(
    left_open: str, terminals: Terminals, endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was there before the first `zteam up`, and stays over its end, gets the data of this team and the next."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crowd.py").write_text(NODE)
    command, meets = LEFT_OPEN[left_open]
    terminals.run("tool", *command)
    wait_for_router(endpoint)
    for team in TEAMS:
        begin = len(terminals.said["tool"])
        terminals.start_team(team)
        assert f"router at {endpoint};" in terminals.wait_for("up", "processes, router at ")
        terminals.wait(lambda begin=begin, team=team: meets(terminals.said["tool"][begin:], team == TEAMS[0]))
        terminals.stop("up")


def test_a_page_that_is_left_open_shows_each_team(terminals: Terminals, endpoint: str) -> None:
    """Map, scans and states of this team's robots and of the next one's."""
    terminals.run("view", "zteam", "zteam-view", "--port", "0", "--token", TOKEN, "--no-browser")
    address = terminals.wait_for("view", "the view is at http")
    with open_page(int(address.partition("127.0.0.1:")[2].partition("/")[0])) as page:
        page.say(op="look", layers=["scans"], docs=[], beams=90)

        def states() -> list[str]:
            return [row["state"] for row in page.docs.get("team", {}).get("robots", [])]

        for team in TEAMS:
            page.blocks.clear()
            terminals.start_team(team)
            assert f"router at {endpoint};" in terminals.wait_for("up", "processes, router at ")
            page.wait(lambda: {(GRID, TEAM), (SCAN, 0), (SCAN, 1)} <= page.blocks.keys())
            page.wait(lambda: states().count("running") >= 2)
            terminals.stop("up")
            page.wait(lambda: "running" not in states())


@pytest.mark.parametrize("holder", ["a lone simulator", "a router that was started by hand"])
def test_a_team_leaves_the_port_of_others(holder: str, terminals: Terminals, endpoint: str) -> None:
    """They stay; `zteam up` says how tools reach its team, and `zteam doctor` names either router at the other one."""
    if holder == "a lone simulator":
        terminals.run("holder", "zteam", "zteam-sim", "arena")
        wait_for_router(endpoint)
        with closing(connect(BusOptions(connect=endpoint), patience=LIMIT)) as bus:
            there = threading.Event()
            bus.watch_tokens([names.tokens_key(names.SIMULATOR)], lambda _key, _alive: there.set())
            assert there.wait(LIMIT)
    else:
        terminals.run("holder", "zteam", "zteam-router", "--listen", endpoint)
        terminals.wait_for("holder", "router at ")
    pid = router_pid(endpoint)
    terminals.start_team()
    place = terminals.wait_for("up", "export ZTEAM_CONNECT=").rpartition("=")[2]
    assert place != endpoint
    terminals.run("doctor", "zteam", "doctor")
    terminals.wait_for("doctor", f"another router of this machine, at {place}, has processes: monitor, robot_0")
    terminals.run("doctor", "zteam", "doctor", ZTEAM_CONNECT=place)
    terminals.wait_for("doctor", f"tools without --connect use another port: zteam-router at {endpoint}, process {pid}")
    terminals.stop("up")
    assert router_pid(endpoint) == pid


def test_of_two_teams_at_once_one_gets_the_port_of_a_tool(terminals: Terminals, endpoint: str) -> None:
    """The tool meets that one; the other one says where it is, and neither ends the other."""
    terminals.run("log", "zteam", "log")
    wait_for_router(endpoint)
    for name in ("one", "other"):
        terminals.run(name, "zteam", "up", "arena")
    for name in ("one", "other"):
        terminals.wait_for(name, "All robots GO!")
    found = {name: terminals.wait_for(name, "processes, router at ") for name in ("one", "other")}
    (far,) = [name for name, line in found.items() if f"router at {endpoint};" not in line]
    assert f"export ZTEAM_CONNECT={found[far].partition('router at ')[2].partition(';')[0]}" in terminals.wait_for(
        far, "is in use"
    )
    terminals.wait(lambda: log_meets(terminals.said["log"], True))
    terminals.stop("one", "other")
