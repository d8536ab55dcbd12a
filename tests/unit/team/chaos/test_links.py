"""The links of a team, and the query that changes them, on a bus in memory."""

import socket
from collections.abc import Iterator
from contextlib import closing

import pytest

from support.limits import LIMIT
from zteam.bus.memory import MemoryHub
from zteam.errors import BusError, UsageError
from zteam.team.chaos.links import Links
from zteam.team.chaos.means import LinkReply, LinkRequest, Wire, no_link

STALLED = Wire(stalled=True)


@pytest.fixture
def router() -> Iterator[socket.socket]:
    """A listening socket in its place."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(LIMIT)
        yield server


@pytest.fixture
def links() -> Iterator[Links]:
    """The links of a team."""
    with closing(Links()) as made:
        yield made


def connect(links: Links, name: str, router: socket.socket) -> tuple[socket.socket, socket.socket]:
    """A connection of a process: its own end, and the router's."""
    endpoint = links.endpoint(name, f"tcp/127.0.0.1:{router.getsockname()[1]}")
    near = socket.create_connection(("127.0.0.1", int(endpoint.rpartition(":")[2])), LIMIT)
    far = router.accept()[0]
    far.settimeout(LIMIT)
    return near, far


def test_each_process_has_a_link_of_its_own(links: Links, router: socket.socket) -> None:
    """A cut link holds what its process says, and no other's."""
    cut, far_cut = connect(links, "robot_1", router)
    good, far_good = connect(links, "robot_2", router)
    with cut, far_cut, good, far_good:
        links.change("robot_1", STALLED)
        for _ in range(2):
            cut.sendall(b"x")
            good.sendall(b"y")
            assert far_good.recv(1) == b"y"
        far_cut.setblocking(False)
        with pytest.raises(BlockingIOError):
            far_cut.recv(1)
        far_cut.settimeout(LIMIT)
        links.change("robot_1", Wire())
        assert far_cut.recv(1) == b"x"


def test_a_link_heals_by_itself(links: Links, router: socket.socket) -> None:
    """What a cut link holds comes through after its time, though nothing heals it."""
    near, far = connect(links, "robot_1", router)
    with near, far:
        links.change("robot_1", STALLED, 0.05)
        near.sendall(b"x")
        assert far.recv(1) == b"x"


def test_a_link_keeps_the_kind_of_the_router(links: Links) -> None:
    """Over TLS the bytes pass as they are, so a process speaks TLS with its link; other kinds are refused."""
    assert links.endpoint("tf", "tls/127.0.0.1:7447").startswith("tls/127.0.0.1:")
    assert links.endpoint("tf", "tls/127.0.0.1:7447") == links.endpoint("tf", "tls/127.0.0.1:7448")
    with pytest.raises(UsageError, match="unixsock-stream/x: a link can be cut if"):
        links.endpoint("tf", "unixsock-stream/x")


def test_the_launcher_changes_links_when_it_is_asked(links: Links, router: socket.socket) -> None:
    """An unknown process is refused with those that there are, and a team without links says how it gets them."""
    near, far = connect(links, "robot_1", router)
    hub = MemoryHub()
    links.serve(hub.bus())
    with near, far:
        found = hub.bus().query("up/links", LinkReply, LinkRequest(name="robot_1", wire=STALLED))
        assert [reply.names for _, reply in found] == [["robot_1"]]
        with pytest.raises(BusError, match="no link of 'robot_9'; there are those of robot_1"):
            hub.bus().query("up/links", LinkReply, LinkRequest(name="robot_9"))
    with pytest.raises(BusError, match="zteam up --chaos"):
        no_link("robot_1", STALLED, 1.0)
