"""In which order a warm parent does what it is asked for."""

import os
import socket
import sys

import pytest

from zteam.launch import fork_server
from zteam.launch.fork_protocol import Load, Message, Reply, Start, has_message, make_sockets, receive_reply, send
from zteam.launch.preloads import PRELOADS, all_preloads, preloads_of
from zteam.launch.process import zteam_command


def order(*needs: str) -> Start:
    """An order for a child that needs these modules."""
    return Start([], {}, b"/", 0o22, [], needs)


def test_a_child_does_not_wait_for_what_others_need(monkeypatch: pytest.MonkeyPatch) -> None:
    """An order that comes during an import is next: what the child needs is imported, it is forked, then the rest."""
    launcher, parent = make_sockets()
    done: list[str] = []
    replies: list[Reply] = []

    def load(module: str) -> None:
        done.append(module)
        if module == "first":
            send(launcher, order("its own"), [0, 1, 2, 2])
        if module == "last":
            replies.append(receive_reply(launcher))
            launcher.close()

    def start(control: socket.socket, *_: object) -> None:
        done.append("fork")
        send(control, Reply(7))

    monkeypatch.setattr(fork_server, "_load", load)
    monkeypatch.setattr(fork_server, "_start", start)
    send(launcher, Load(("first", "last")))
    with parent:
        assert fork_server.serve(parent) is None
    assert done == ["first", "its own", "fork", "last"]
    assert replies == [Reply(7)]


def test_a_launcher_that_is_gone_ends_the_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left is not imported."""
    launcher, parent = make_sockets()
    done: list[str] = []

    def load(module: str) -> None:
        done.append(module)
        launcher.close()

    monkeypatch.setattr(fork_server, "_load", load)
    send(launcher, Load(("first", "last")))
    with parent:
        assert fork_server.serve(parent) is None
    assert done == ["first"]


def test_a_message_that_is_there_is_not_taken() -> None:
    """To look does not wait, and leaves the message."""
    launcher, parent = make_sockets()
    message: Message = Load(("numpy",))
    with launcher, parent:
        assert not has_message(parent)
        send(launcher, message)
        assert has_message(parent)
        assert has_message(parent)
        assert fork_server.receive(parent) == (message, [])
        assert not has_message(parent)


def test_every_command_of_a_team_has_its_modules() -> None:
    """A process for which none are named needs them all; the simulator does not wait for those of the robots."""
    assert preloads_of(zteam_command("zteam-router")) == PRELOADS["zteam.cli.zteam_router"]
    assert preloads_of(zteam_command("zteam", "world")) == all_preloads()
    assert "zteam.nodes.robot.node" not in preloads_of(zteam_command("zteam-sim", "office"))
    assert len(set(all_preloads())) == len(all_preloads())


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="references to names are not counted")
def test_a_child_inherits_no_names_in_the_cache_of_types(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that an import looked up is held by the cache of types, and no longer when the parent forks."""
    monkeypatch.setattr(os, "fork", lambda: 7)
    name = sys.intern("a_name_that_no_module_asks_for")
    before = sys.getrefcount(name)
    assert not hasattr(fork_server.Program, name)
    assert sys.getrefcount(name) > before
    assert fork_server._fork() == 7
    assert sys.getrefcount(name) == before
