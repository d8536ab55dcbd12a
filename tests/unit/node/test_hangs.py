"""Where a process hangs, and which silence is its own."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.node.faults import STACKS, where_it_is

Start = Callable[..., "subprocess.Popen[str]"]
CHILD = """
import sys, threading
from zteam.node.faults import offer_stacks
from zteam.node.shutdown import Stop
from zteam.node.working import StepWatch

def step():
    # The line of the user's code, below Python's own.
    print("here", flush=True), threading.Event().wait()

def outside():
    # Python's lock is held, so no other thread runs.
    print("here", flush=True), sum(iter(int, 1))

def run(step):
    StepWatch("step", "", "").run(step, 0.0, paced=False)

stop = Stop()
offer_stacks(sys.argv[1], stop)
stop.install()
threading.Thread(target=threading.Event().wait, daemon=True).start()
if sys.argv[2] == "step":
    run(step)
if sys.argv[2] == "outside":
    threading.Thread(target=run, args=(outside,), daemon=True).start()
    threading.Event().wait()
step()
"""


@pytest.fixture
def stacks(tmp_path: Path) -> Path:
    """The folder of those of a team."""
    folder = tmp_path / "stacks"
    folder.mkdir()
    return folder


def end(child: "subprocess.Popen[str]") -> None:
    """Nothing is left of it."""
    child.kill()
    child.communicate(timeout=LIMIT)


@pytest.fixture
def start(tmp_path: Path, stacks: Path) -> Iterator[Start]:
    """`start(name, way)`: a process that has come to the user's line."""
    with ExitStack() as ends:

        def start(name: str, way: str = "step", *, offers: bool = True) -> "subprocess.Popen[str]":
            script, environment = tmp_path / "wårk er.py", {STACKS: str(stacks)} if offers else {}
            script.write_text(CHILD)
            command = [sys.executable, script, name, way]
            child = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
            ends.callback(end, child)
            assert child.stdout is not None
            assert child.stdout.readline() == "here\n"
            return child

        yield start


def test_the_users_line_is_found(tmp_path: Path, stacks: Path, start: Start) -> None:
    """Neither zteam's frames nor Python's are the place, and each question gets the answer of now; a path may have any
    letters."""
    start("robot_0")
    for _ in range(2):
        first, *rest = where_it_is(str(stacks), "robot_0").splitlines()
        assert first == f"step has not returned ({tmp_path}/wårk er.py:9)"
        assert rest[0] == "Traceback (most recent call last):"
        assert '    print("here", flush=True), threading.Event().wait()' in rest


@pytest.mark.ci
def test_a_call_that_lets_no_other_thread_run_is_found(stacks: Path, start: Start) -> None:
    """The process cannot answer by itself, and Python's fault handler does."""
    start("robot_0", "outside")
    assert where_it_is(str(stacks), "robot_0").startswith("outside has not returned (")


def test_only_a_living_process_that_offered_it_is_signalled(stacks: Path, start: Start) -> None:
    """Others would end by the signal: one of the same name without the folder, and one that got a dead one's number."""
    others = start("robot_0", offers=False)
    assert where_it_is(str(stacks), "robot_0") == ""
    dead = start("robot_1")
    end(dead)
    (found,) = stacks.glob("robot_1.*")
    found.rename(found.with_suffix(f".{others.pid}"))
    assert where_it_is(str(stacks), "robot_1") == ""
    assert others.poll() is None


def test_a_wait_of_zteam_is_no_call_of_the_user(stacks: Path, start: Start) -> None:
    """A script that waits below no function of zteam is in none of its calls."""
    start("node", "script")
    assert where_it_is(str(stacks), "node") == ""
