"""The link to the launcher: what a process finds there, and what it does when the launcher is gone."""

import os
import socket
import threading

import pytest

from support.limits import LIMIT
from zteam.node import launcher
from zteam.node.shutdown import Stop


def test_a_launcher_that_is_gone_stops_the_process_though_it_left_a_report_unread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A socket whose other end closed with unread data has no end of the file: its reads fail."""
    ours, theirs = socket.socketpair()
    monkeypatch.setattr(launcher, "_link", None)
    monkeypatch.setenv(launcher.LINK, str(theirs.fileno()))
    launcher.report(listening="tcp/127.0.0.1:5")
    ours.close()
    stop, asked = Stop(), threading.Event()
    stop.on_request(asked.set)
    with stop.install():
        assert asked.wait(LIMIT)
    theirs.close()


def test_a_number_that_was_passed_on_without_its_descriptor_is_no_link(monkeypatch: pytest.MonkeyPatch) -> None:
    """What this process opens under that number later gets no report."""
    reader, writer = os.pipe()
    monkeypatch.setattr(launcher, "_link", None)
    for number in (writer, 10**6):
        monkeypatch.setenv(launcher.LINK, str(number))
        assert launcher.take_link() is None
    os.close(reader)
    os.close(writer)
