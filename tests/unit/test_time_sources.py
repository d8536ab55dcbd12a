"""One place knows other time than the simulator's: nothing else in the package looks at a clock or sleeps."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "zteam"

MODULES = {"time", "datetime", "sched", "timeit", "zoneinfo"}
"""Modules that know time, whatever is taken from them."""
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
"""What sleeps or measures in modules that are good for other things."""

ALLOWED = {
    ("clock.py", "time"): "this is the place",
    ("runtime/shutdown.py", "threading.Timer"): "the hard exit: the process may hang, so nobody is there to wait",
    (
        "bus/connection.py",
        "threading.Timer",
    ): "a router's revival must not hold Zenoh's thread, nor all race for a port",
    ("bus/connection.py", "select.select"): "an endpoint comes over stdin, and a request to stop has no descriptor",
}
"""(file, what): why it may."""


def sources_of_time(code: str) -> Iterator[str]:
    """What a module's code takes of MODULES and NAMES, under any alias."""
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
    """All sources of time in the package: (file, what) -> where."""
    return {
        (path.relative_to(PACKAGE).as_posix(), what): str(path)
        for path in sorted(PACKAGE.rglob("*.py"))
        for what in sources_of_time(path.read_text(encoding="utf-8"))
    }


def test_only_the_clock_knows_time() -> None:
    """Who needs time takes it from zteam/clock.py, or waits for a condition; the exceptions have reasons."""
    new = sorted(set(found()) - set(ALLOWED))
    assert not new, f"use zteam.clock, or wait for a condition, instead of: {new}"


def test_no_exception_outlives_its_reason() -> None:
    """What is allowed above is still there."""
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
    """The test sees through aliases, and into functions."""
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
    """Bounded waits for a condition, and names that only look like time, are nobody's concern."""
    assert list(sources_of_time(code)) == []
