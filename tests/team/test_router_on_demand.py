"""The router on demand: on a port of the test's own, never the machine's default one."""

import os
import random
import select
import signal
import socket
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.transports import Inbox, wait_until_true
from zteam.bus import BusOptions, connect, router
from zteam.bus.router import RouterMetadata, read_admin, router_log_path
from zteam.clock import HOST_FACTOR
from zteam.errors import BusError
from zteam.messages import Bool
from zteam.team.launch.process import Job
from zteam.team.launch.supervisor import Supervisor

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
import sys
from zteam.bus import options, router
options.DEFAULT_ENDPOINT, router.IDLE_EXIT = {!r}, 1.0
from zteam.bus import BusOptions, connect
from zteam.messages import Bool
bus = connect(BusOptions())
bus.subscribe("flag", Bool, print)
{}
"""


def test_a_script_that_does_not_close_ends(endpoint: str) -> None:
    """A script without `bus.close()` ends with its own exit code."""
    script = ENDING.format(endpoint, "sys.exit(3)")
    assert subprocess.run([sys.executable, "-c", script], timeout=LIMIT, check=False).returncode == 3


def test_the_first_client_starts_it_and_it_ends_with_the_last(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs in a session of its own, and its log says why it ended. Another user joins it with --connect only: on a
    shared machine two users' teams must not mix by accident."""
    first, second, told, owner = connect(BusOptions()), connect(BusOptions()), Inbox(), os.getuid()
    pid = router_pid(endpoint)
    assert os.getsid(pid) != os.getsid(0)
    second.subscribe("a", Bool, told, latched=True)
    first.publisher("a", Bool, latched=True).put(Bool(True))
    told.wait_count(1)
    with monkeypatch.context() as patched:
        patched.setattr(os, "getuid", lambda: 12345)
        with pytest.raises(BusError, match=rf"belongs to user id {owner}:.*--connect"):
            connect(BusOptions())
        connect(BusOptions(connect=endpoint)).close()
    first.close()
    second.close()
    wait_for_end(pid)
    assert "the router ends" in router_log_path(endpoint).read_text()


def test_a_router_that_dies_is_started_again(endpoint: str) -> None:
    """Both clients reconnect, and their subscribers and publishers work again."""
    with closing(connect(BusOptions())) as first, closing(connect(BusOptions())) as second:
        told, pid = Inbox(), router_pid(endpoint)
        publisher = first.publisher("a", Bool)
        second.subscribe("a", Bool, told)
        os.kill(pid, signal.SIGKILL)
        wait_for_end(pid)
        wait_until_true(lambda: publisher.put(Bool(True)) or bool(told.items))
        assert router_pid(endpoint) != pid


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
        self._supervisor = Supervisor(lambda name, line: self.said[name].append(line))

    def run(self, name: str, program: str, *words: str, **environment: str) -> None:
        """Start a module or a file; its lines begin anew."""
        self.said[name] = []
        command = [sys.executable, "-P", "-c", AS_DEFAULT, self._endpoint, program, *words]
        self._supervisor.start_job(name, Job(command, environment))

    def start_team(self, team: str = "arena") -> None:
        """`zteam up`, until its robots drive."""
        self.run("up", "zteam", "up", team)
        self.wait(lambda: any("All robots GO!" in line for line in list(self.said["up"])))

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
    """It prints a line of a robot of the team."""
    return any(f"[robot_{1 if is_first else 3}] behaviour " in line for line in lines)


LEFT_OPEN = {
    "node": (("crowd.py",), node_meets),
    "topic echo": (("zteam", "topic", "echo", "robot_$*/odom", "--json"), echo_meets),
    "log": (("zteam", "log"), log_meets),
}


def test_what_is_left_open_meets_each_team(
    terminals: Terminals, endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was there before the first `zteam up`, and stays over its end, gets the data of this team and the next: each
    team gets the port of the router on demand."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crowd.py").write_text(NODE)
    for name, (command, _) in LEFT_OPEN.items():
        terminals.run(name, *command)
    wait_for_router(endpoint)
    for team in TEAMS:
        begins = {name: len(terminals.said[name]) for name in LEFT_OPEN}
        terminals.start_team(team)
        assert f"router at {endpoint};" in terminals.wait_for("up", "processes, router at ")
        for name, (_, meets) in LEFT_OPEN.items():
            terminals.wait(lambda: meets(terminals.said[name][begins[name] :], team == TEAMS[0]))  # noqa: B023
        terminals.stop("up")
