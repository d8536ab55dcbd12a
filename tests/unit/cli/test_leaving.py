"""How the process of a command ends."""

import subprocess
import sys

import pytest

from support.limits import LIMIT

BOMB = "import os, sys; sys.bomb = type('Bomb', (), {'__del__': lambda self, end=os.abort: end()})()\n"
"""Aborts the process when the interpreter is taken apart, as a late callback of foreign code does."""


def run(code: str) -> subprocess.CompletedProcess[str]:
    """Run `code` in a process of its own."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=False)


def test_the_bomb_aborts_a_normal_end() -> None:
    """Without `leave` such a process ends by SIGABRT: the tests below can fail."""
    assert run(BOMB + "sys.exit(3)").returncode == -6


def test_leave_ends_with_the_exit_code_after_all_that_a_normal_end_does() -> None:
    """Threads are waited for, exit handlers run and output is flushed, in this order; then the exit code is kept."""
    done = run(
        BOMB + "import atexit, threading\n"
        "from zteam.node.leaving import leave\n"
        "atexit.register(print, 'handler')\n"
        "may = threading.Event()\n"
        "threading.Thread(target=lambda: (may.wait(30), print('thread'))).start()\n"
        "threading.Timer(0.1, may.set).start()\n"
        "leave(3)"
    )
    assert (done.returncode, done.stdout) == (3, "thread\nhandler\n")


def test_a_closed_output_is_no_failure() -> None:
    """A process that was started without standard output, or closed it, keeps its exit code."""
    for close in ("sys.stdout = None", "sys.stdout.close()"):
        assert run(BOMB + f"from zteam.node.leaving import leave\n{close}\nleave(3)").returncode == 3


@pytest.mark.gate
def test_commands_leave() -> None:
    """A command that ran, one of a process too, ends without taking the interpreter apart."""
    for words in ("'zteam-sim', 'wander'", "'behaviors', 'wandr'"):
        code = f"sys.argv = ['zteam', {words}]; import runpy; runpy.run_module('zteam', run_name='__main__')"
        done = run(BOMB + code)
        assert (done.returncode, "wander" in done.stderr) == (2, True), done.stderr
