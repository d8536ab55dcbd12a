"""One link: whole, delayed, slow, stalled and reset, with plain sockets at both ends."""

import errno
import os
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.clock import monotonic
from zteam.team.chaos import links
from zteam.team.chaos.links import Link, Links, most_held
from zteam.team.chaos.means import Wire


class Ends:
    """A listening socket in the router's place, and connections to it through links."""

    def __init__(self) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.settimeout(LIMIT)
        self.links = Links()
        self.opened: list[socket.socket] = []

    def link(self) -> Link:
        """A link to the server."""
        return self.links.open(*self.server.getsockname())

    def near(self, link: Link) -> socket.socket:
        """A new connection to a link."""
        host, _, port = link.endpoint.removeprefix("tcp/").rpartition(":")
        end = socket.create_connection((host, int(port)), LIMIT)
        self.opened.append(end)
        return end

    def are_refused(self, link: Link) -> bool:
        """Whether a link ends a new connection at once, maybe already while it connects."""
        try:
            return has_ended(self.near(link))
        except ConnectionResetError:
            return True

    def connect(self, link: Link) -> tuple[socket.socket, socket.socket]:
        """A new connection: its end at the process, its end at the router."""
        near, far = self.near(link), self.server.accept()[0]
        far.settimeout(LIMIT)
        self.opened.append(far)
        return near, far

    def close(self) -> None:
        """Close all of it."""
        self.links.close()
        for end in (self.server, *self.opened):
            end.close()


@pytest.fixture
def ends() -> Iterator[Ends]:
    """Both ends of links."""
    found = Ends()
    yield found
    found.close()


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


def pass_by(ends: Ends) -> None:
    """Return when a link has had time for all that was sent before: a good link has passed bytes twice."""
    near, far = ends.connect(ends.link())
    for _ in range(2):
        near.sendall(b"x")
        assert read(far, 1) == b"x"


def count_descriptors() -> int:
    """Those of this process."""
    return len([*Path("/dev/fd").iterdir()])


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
    pass_by(ends)
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
    pass_by(ends)
    assert is_silent(far)
    link.change()
    assert read(far, 4) == b"held"


def test_a_cut_link_passes_nothing_and_loses_nothing(ends: Ends) -> None:
    """While a link is cut no byte and no new connection passes; afterwards all of them do."""
    link = ends.link()
    near, far = ends.connect(link)
    link.change(Wire(stalled=True), Wire(stalled=True))
    pass_by(ends)
    near.sendall(b"up")
    far.sendall(b"down")
    late = ends.near(link)
    late.sendall(b"late")
    pass_by(ends)
    assert is_silent(near) and is_silent(far)
    link.change()
    assert read(far, 2) == b"up" and read(near, 4) == b"down"
    came = ends.server.accept()[0]
    ends.opened.append(came)
    assert read(came, 4) == b"late"


def test_a_cut_stops_what_waits_for_the_router(ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    """A router that reads again during a cut gets nothing of what the link had begun to send."""
    link, passed, real = ends.link(), list[int](), socket.socket.send
    near, far = ends.connect(link)
    near.setblocking(False)
    for _ in range(3):
        with pytest.raises(BlockingIOError):
            while True:
                near.send(bytes(1 << 16))
        pass_by(ends)
    link.change(Wire(stalled=True), Wire(stalled=True))
    pass_by(ends)

    def send(self: socket.socket, data: bytes) -> int:
        count = real(self, data)
        if self.getpeername() == far.getsockname() and self.getsockname() == far.getpeername():
            passed.append(count)
        return count

    monkeypatch.setattr(socket.socket, "send", send)
    while not is_silent(far):
        far.recv(1 << 20)
        pass_by(ends)
    assert not passed
    link.change()
    assert far.recv(1)


def test_a_reset_link_ends_its_connections_and_refuses_new_ones(ends: Ends) -> None:
    """Both ends of a connection hear of a reset, a new connection ends at once, and after it the link connects."""
    link = ends.link()
    near, far = ends.connect(link)
    link.reset()
    assert has_ended(near) and has_ended(far)
    assert ends.are_refused(link)
    link.change()
    near, far = ends.connect(link)
    near.sendall(b"again")
    assert read(far, 5) == b"again"


def test_a_rate_slows_a_direction_and_makes_its_sender_wait(ends: Ends) -> None:
    """100 kB take a second at 100 kB/s less what may pass at once, and a sender of many more is held up."""
    link = ends.link()
    near, far = ends.connect(link)
    link.change(up=Wire(rate=100_000.0))
    pass_by(ends)
    before = monotonic()
    near.setblocking(False)
    sent = 0
    with pytest.raises(BlockingIOError):
        while sent < 1 << 28:
            sent += near.send(bytes(1 << 16))
    assert len(read(far, 50_000)) == 50_000
    assert monotonic() - before >= 0.4


def test_a_router_that_is_away_ends_the_connection(ends: Ends) -> None:
    """A process that connects while the router does not listen hears the end at once, and gets through later."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = free.getsockname()
    link = ends.links.open(*address)
    assert ends.are_refused(link)
    with socket.create_server(address) as back:
        back.settimeout(LIMIT)
        near, far = ends.near(link), back.accept()[0]
        ends.opened.append(far)
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


def test_connections_without_an_answer_keep_no_process_away(ends: Ends) -> None:
    """Of those that the router has not answered the oldest makes room; those that it has answered stay, and there are
    no more than a few."""
    link = ends.link()
    pairs = []
    for _ in range(8):
        for _ in range(2):
            silent, far = ends.connect(link)
        silent.sendall(b"x")
        assert read(far, 1) == b"x"
        far.sendall(b"y")
        assert read(silent, 1) == b"y"
        pairs.append((silent, far))
    assert ends.are_refused(link)
    for near, far in pairs:
        near.sendall(b"on")
        assert read(far, 2) == b"on"


@pytest.mark.parametrize("call", ["accept", "__init__"])
def test_links_without_a_descriptor_rest_and_say_so_once(
    ends: Ends, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """For the connection of a process or for that to the router; they take connections when there is room again."""
    real, left = getattr(socket.socket, call), [3]

    def take(self: socket.socket, *args: Any, **options: Any) -> Any:
        if threading.current_thread().name == "links" and "fileno" not in options and left[0]:
            left[0] -= 1
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return real(self, *args, **options)

    monkeypatch.setattr(links, "_REST", 0.01)
    made = [ends.link(), ends.link()]
    with captured_log() as log:
        monkeypatch.setattr(socket.socket, call, take)
        refused = [ends.are_refused(made[i % 2]) for i in range(3)] if call == "__init__" else []
        near, far = ends.connect(made[0])
        near.sendall(b"x")
        assert read(far, 1) == b"x"
        ends.connect(made[1])
    assert (left, refused) == ([0], [True] * len(refused))
    assert log.lines == ["a link takes no connection until there is room: [Errno 24] Too many open files"]


def test_a_cut_link_takes_no_descriptors(ends: Ends) -> None:
    """What connects again and again waits in the system, and a connection that is still wanted gets through."""
    link = ends.link()
    link.change(Wire(stalled=True), Wire(stalled=True))
    pass_by(ends)
    before = count_descriptors()
    for _ in range(40):
        ends.near(link).close()
    pass_by(ends)
    # `pass_by` has a link and a connection of its own, and one more may have been waited for before the cut.
    assert count_descriptors() <= before + 10
    ends.near(link).sendall(b"on")
    link.change()
    while not (came := ends.server.accept()[0]).recv(2):
        came.close()
    came.close()


def test_links_leave_nothing_open(ends: Ends) -> None:
    """`close` ends its thread, its connections and its ports."""
    link = ends.link()
    near, far = ends.connect(link)
    endpoint = link.endpoint
    ends.links.close()
    assert [thread.name for thread in threading.enumerate() if thread.name == "links"] == []
    assert has_ended(near) and has_ended(far)
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", int(endpoint.rpartition(":")[2])), LIMIT)
