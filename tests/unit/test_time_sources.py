"""Only zteam/clock.py reads a clock or sleeps."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "zteam"

MODULES = {"time", "datetime", "sched", "timeit", "zoneinfo"}
"""Modules about time: any use of them counts."""
NAMES = {
    "asyncio.sleep",
    "asyncio.timeout",
    "asyncio.wait_for",
    "os.times",
    "select.poll",
    "select.select",
    "signal.alarm",
    "signal.pause",
    "signal.setitimer",
    "signal.sigtimedwait",
    "threading.Timer",
}
"""Functions and classes that sleep or measure time, in modules with other uses."""

ALLOWED = {
    ("clock.py", "time"): "the one module for clocks",
    ("runtime/shutdown.py", "threading.Timer"): "the hard exit: the process may hang, so no other thread can wait",
    (
        "bus/connection.py",
        "threading.Timer",
    ): "restarting a router must not block Zenoh's thread, and clients must not all try at once",
    (
        "bus/connection.py",
        "select.select",
    ): "the read of an endpoint must notice a request to stop",
    (
        "launch/forked_child.py",
        "select.poll",
    ): "a process that another one forked has ended when its descriptor can be read; no time is measured",
    (
        "launch/restarts.py",
        "threading.Timer",
    ): "a restart is due at host time, while the launcher waits for the end of the run",
    (
        "nodes/simulator/answers.py",
        "threading.Timer",
    ): "an answer without a token is refused at host time, while the world may be held and no thread looks",
    (
        "nodes/web/connection.py",
        "asyncio.wait_for",
    ): "a page that says nothing is let go, while the server's thread serves others",
    (
        "nodes/web/connection.py",
        "asyncio.sleep",
    ): "a page gets so many frames a second of host time, on the thread that serves all pages",
    (
        "nodes/web/orders.py",
        "asyncio.sleep",
    ): "a page that says too much is read later, on the thread that serves all pages",
    (
        "cli/teleop_terminal.py",
        "select.select",
    ): "a key must not wait for the next command, and the next command must not wait for a key",
}
"""(file, source of time): the reason."""


def sources_of_time(code: str) -> Iterator[str]:
    """The uses of MODULES and NAMES in a module's code, under any alias."""
    known: dict[str, str] = {}
    nodes = list(ast.walk(ast.parse(code)))
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                root = alias.name.partition(".")[0]
                known[alias.asname or root] = alias.name if alias.asname else root
                if root in MODULES:
                    yield root
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                if node.module.partition(".")[0] in MODULES:
                    yield node.module.partition(".")[0]
                elif name in NAMES:
                    yield name
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            name = f"{known.get(node.value.id, '')}.{node.attr}"
            if name in NAMES:
                yield name


@cache
def found() -> dict[tuple[str, str], str]:
    """All sources of time in the package: (file, source) -> path."""
    return {
        (path.relative_to(PACKAGE).as_posix(), what): str(path)
        for path in sorted(PACKAGE.rglob("*.py"))
        for what in sources_of_time(path.read_text(encoding="utf-8"))
    }


def test_only_the_clock_module_uses_time() -> None:
    """No module but zteam/clock.py uses a source of time without a reason in ALLOWED."""
    new = sorted(set(found()) - set(ALLOWED))
    assert not new, f"use zteam.clock, or wait for a condition, instead of: {new}"


def test_no_exception_outlives_its_reason() -> None:
    """Every entry of ALLOWED is still used."""
    assert not set(ALLOWED) - set(found())


@pytest.mark.parametrize(
    ("code", "what"),
    [
        ("import time", "time"),
        ("import time as t", "time"),
        ("import os, time", "time"),
        ("from time import sleep", "time"),
        ("def f():\n    from time import monotonic as m\n", "time"),
        ("from datetime import datetime", "datetime"),
        ("import sched", "sched"),
        ("from asyncio import sleep", "asyncio.sleep"),
        ("import asyncio as a\nasync def f():\n    await a.sleep(1)\n", "asyncio.sleep"),
        ("import threading\nthreading.Timer(1, print).start()", "threading.Timer"),
        ("from threading import Lock, Timer", "threading.Timer"),
        ("class T(threading.Timer): ...\nimport threading", "threading.Timer"),
        ("import signal\nsignal.setitimer(0, 1)", "signal.setitimer"),
    ],
)
def test_sources_are_found(code: str, what: str) -> None:
    """Sources of time are found under aliases and inside functions."""
    assert list(sources_of_time(code)) == [what]


@pytest.mark.parametrize(
    "code",
    [
        "from zteam.clock import monotonic, pause",
        "import threading\nthreading.Event().wait(0.5)",
        "from zteam import clock\nclock.time = 3",
        "from .time import x",
        "self.time.sleep = 1",
        "import asyncio\nasyncio.run(f())",
    ],
)
def test_other_code_is_left_alone(code: str) -> None:
    """Bounded waits for a condition, and other names that look like time, are not reported."""
    assert list(sources_of_time(code)) == []
