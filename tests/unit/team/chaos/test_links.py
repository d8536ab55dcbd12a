"""Links: whole, delayed, slow and cut, with plain sockets at both ends; and the query that changes them."""

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest

from support.limits import LIMIT
from zteam.bus.memory import MemoryHub
from zteam.clock import monotonic
from zteam.errors import BusError, UsageError
from zteam.team.chaos.links import Link, Links, most_held
from zteam.team.chaos.means import LinkReply, LinkRequest, Wire, no_link

STALLED = Wire(stalled=True)


class Ends:
    """A listening socket in the router's place, and connections to it through the links of processes."""

    def __init__(self, opened: ExitStack) -> None:
        self._opened = opened
        self.server = opened.enter_context(socket.create_server(("127.0.0.1", 0)))
        self.server.settimeout(LIMIT)
        self.links = opened.enter_context(closing(Links()))

    def link(self, name: str = "robot_1") -> Link:
        """The link of a process to the server."""
        self.links.endpoint(name, f"tcp/127.0.0.1:{self.server.getsockname()[1]}")
        return self.links._links[name]

    def near(self, link: Link) -> socket.socket:
        """A new connection to a link."""
        return self._opened.enter_context(socket.create_connection(("127.0.0.1", link.port), LIMIT))

    def far(self) -> socket.socket:
        """The router's end of the next connection."""
        far = self._opened.enter_context(self.server.accept()[0])
        far.settimeout(LIMIT)
        return far

    def connect(self, link: Link) -> tuple[socket.socket, socket.socket]:
        """A new connection: its end at the process, its end at the router."""
        return self.near(link), self.far()

    def pass_by(self) -> None:
        """Return when a link has had time for all that was sent before: a good link has passed bytes twice."""
        near, far = self.connect(self.link("good"))
        for _ in range(2):
            near.sendall(b"x")
            assert read(far, 1) == b"x"


@pytest.fixture
def ends() -> Iterator[Ends]:
    """Both ends of links."""
    with ExitStack() as opened:
        yield Ends(opened)


def read(end: socket.socket, count: int) -> bytes:
    """Exactly this many bytes."""
    data = b""
    while len(data) < count:
        part = end.recv(count - len(data))
        assert part, f"the connection ended after {len(data)} of {count} bytes"
        data += part
    return data


def is_silent(end: socket.socket) -> bool:
    """Whether nothing has come."""
    end.setblocking(False)
    try:
        end.recv(1, socket.MSG_PEEK)
    except BlockingIOError:
        return True
    finally:
        end.settimeout(LIMIT)
    return False


def has_ended(end: socket.socket) -> bool:
    """Whether the next thing that comes is the end of the connection, with a reset or without."""
    try:
        return end.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.mark.ci
def test_a_good_link_passes_all_bytes_both_ways_and_its_end(ends: Ends) -> None:
    """Megabytes come out as they went in, in both directions at once, and so does the end of each."""
    near, far = ends.connect(ends.link())
    sent = bytes(range(256)) * 40_000
    writers = [threading.Thread(target=end.sendall, args=(sent,), daemon=True) for end in (near, far)]
    got: dict[socket.socket, bytes] = {}
    readers = [
        threading.Thread(target=lambda end=end: got.update({end: read(end, len(sent))}), daemon=True)
        for end in (near, far)
    ]
    for thread in (*writers, *readers):
        thread.start()
    for thread in (*writers, *readers):
        thread.join(LIMIT)
    assert got == {near: sent, far: sent}
    near.shutdown(socket.SHUT_WR)
    assert far.recv(1) == b""
    far.sendall(b"last")
    assert read(near, 4) == b"last"
    far.close()
    assert near.recv(1) == b""


def test_a_delay_holds_one_direction_and_keeps_the_order(ends: Ends) -> None:
    """Bytes take the delay of their direction; those of the other direction do not wait for them."""
    link = ends.link()
    near, far = ends.connect(link)
    link.change(up=Wire(delay=0.3))
    ends.pass_by()
    before = monotonic()
    near.sendall(b"first")
    near.sendall(b"second")
    far.sendall(b"back")
    assert read(near, 4) == b"back"
    assert is_silent(far) or monotonic() >= before + 0.3
    assert read(far, 11) == b"firstsecond"
    assert monotonic() >= before + 0.3


@pytest.mark.parametrize(("rate", "held"), [(None, 1 << 19), (1e5, 50_000), (4e6, 2_000_000), (1e9, 1 << 22)])
def test_a_delayed_direction_holds_what_its_rate_brings(rate: float | None, held: int) -> None:
    """Held less, it would pass fewer bytes a second than it was told to; with a bound it takes little memory."""
    assert held < most_held(Wire(delay=0.5, rate=rate)) <= held + (1 << 16)


def test_the_end_of_a_delay_frees_what_is_held(ends: Ends) -> None:
    """When a link becomes good again, its bytes do not wait for a delay that is over."""
    link = ends.link()
    near, far = ends.connect(link)
    link.change(up=Wire(delay=10.0 * LIMIT))
    near.sendall(b"held")
    ends.pass_by()
    assert is_silent(far)
    link.change()
    assert read(far, 4) == b"held"


def test_a_cut_link_passes_nothing_and_loses_nothing(ends: Ends) -> None:
    """While a link is cut no byte and no new connection passes; afterwards all of them do."""
    link = ends.link()
    near, far = ends.connect(link)
    ends.links.change("robot_1", STALLED)
    ends.pass_by()
    near.sendall(b"up")
    far.sendall(b"down")
    ends.near(link).sendall(b"late")
    ends.pass_by()
    assert is_silent(near) and is_silent(far)
    link.change()
    assert read(far, 2) == b"up" and read(near, 4) == b"down"
    assert read(ends.far(), 4) == b"late"


def test_a_link_heals_by_itself(ends: Ends) -> None:
    """What a cut link holds comes through after its time, though nothing heals it."""
    near, far = ends.connect(ends.link())
    ends.links.change("robot_1", STALLED, 0.05)
    near.sendall(b"x")
    assert read(far, 1) == b"x"


def test_a_rate_slows_a_direction_and_makes_its_sender_wait(ends: Ends) -> None:
    """100 kB take a second at 100 kB/s less what may pass at once, and a sender of many more is held up."""
    link = ends.link()
    near, far = ends.connect(link)
    link.change(up=Wire(rate=100_000.0))
    ends.pass_by()
    before = monotonic()
    near.setblocking(False)
    sent = 0
    with pytest.raises(BlockingIOError):
        while sent < 1 << 28:
            sent += near.send(bytes(1 << 16))
    assert len(read(far, 50_000)) == 50_000
    assert monotonic() - before >= 0.4


def test_a_router_that_is_away_ends_the_connection(ends: Ends) -> None:
    """A process that connects while the router does not listen gets the end at once, and gets through later."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = free.getsockname()
    link = ends.links.open(*address)
    assert has_ended(ends.near(link))
    with socket.create_server(address) as back:
        back.settimeout(LIMIT)
        near, far = ends.near(link), back.accept()[0]
        with far:
            near.sendall(b"now")
            assert read(far, 3) == b"now"


def test_the_last_words_of_a_process_that_has_ended_pass(ends: Ends) -> None:
    """The last bytes of a process arrive, also while the router still sends bytes to it."""
    near, far = ends.connect(ends.link())
    far.sendall(bytes(1 << 20))
    near.sendall(b"stop")
    near.shutdown(socket.SHUT_WR)
    near.close()
    assert read(far, 4) == b"stop"
    assert far.recv(1) == b""


def test_the_last_words_pass_though_a_reset_follows(ends: Ends) -> None:
    """Bytes that came before a reset are passed on, also on a slow link, while those the other way can no longer be."""
    link = ends.link()
    near, far = ends.connect(link)
    link.change(up=STALLED)
    near.sendall(b"read ")
    ends.pass_by()
    near.sendall(b"unread")
    near.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    near.close()
    far.sendall(b"to nobody")
    ends.pass_by()
    link.change()
    assert read(far, 11) == b"read unread"
    assert far.recv(1) == b""


def test_links_leave_nothing_open(ends: Ends, caplog: pytest.LogCaptureFixture) -> None:
    """`close` ends its thread, its connections and its ports, and says nothing."""
    link = ends.link()
    near, far = ends.connect(link)
    ends.links.close()
    assert [thread.name for thread in threading.enumerate() if thread.name == "links"] == []
    assert has_ended(near) and has_ended(far)
    with pytest.raises(OSError):
        ends.near(link)
    assert not caplog.records


def test_a_link_keeps_the_kind_of_the_router(ends: Ends) -> None:
    """Over TLS the bytes pass as they are, so a process speaks TLS with its link; other kinds are refused."""
    assert ends.links.endpoint("tf", "tls/127.0.0.1:7447").startswith("tls/127.0.0.1:")
    assert ends.links.endpoint("tf", "tls/127.0.0.1:7447") == ends.links.endpoint("tf", "tls/127.0.0.1:7448")
    with pytest.raises(UsageError):
        ends.links.endpoint("tf", "unixsock-stream/x")


def test_the_launcher_changes_links_when_it_is_asked(ends: Ends) -> None:
    """An unknown process is refused, and so is any in a team without links."""
    link, hub = ends.link(), MemoryHub()
    ends.links.serve(hub.bus())
    found = hub.bus().query("up/links", LinkReply, LinkRequest(name="robot_1", wire=STALLED))
    assert [reply.names for _, reply in found] == [["robot_1"]]
    assert (link.up, link.down) == (STALLED, STALLED)
    with pytest.raises(BusError):
        hub.bus().query("up/links", LinkReply, LinkRequest(name="robot_9"))
    with pytest.raises(BusError):
        no_link("robot_1", STALLED, 1.0)
