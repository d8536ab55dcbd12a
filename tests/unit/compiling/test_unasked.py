"""Kernels that are compiled only where that is asked for: robots run them as they are kept, or plain."""

import os
import select
import subprocess
import sys
import textwrap
from functools import partial
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.transports import wait_until_true
from zteam.compiling import kernel_cache
from zteam.compiling.kernels import has_numba
from zteam.launch.process import zteam_command

pytestmark = pytest.mark.skipif(not has_numba(), reason="numba is not installed")
RUN = """
import sys
from zteam.behaviors.jit import BEHAVIOR_KERNELS as KERNELS
from zteam.behaviors.kernel_samples import call_kernels
from zteam.compiling.takeover import prepare, run_kept

def show():
    called = [kernel for kernel in KERNELS.kernels if not kernel.name.rpartition(".")[2].startswith("_")]
    print(KERNELS.choice, sum(kernel._kept is not None for kernel in called), "numba" in sys.modules, flush=True)
"""


def start(code: str, folder: Path) -> "subprocess.Popen[str]":
    """A process that runs RUN and `code`, with `folder` as its cache."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", RUN + textwrap.dedent(code)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def run(code: str, folder: Path) -> str:
    """What it says."""
    process = start(code, folder)
    output, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, output
    return output


def children_of(process: "subprocess.Popen[str]") -> list[int]:
    """The ids of its children."""
    return [int(word) for word in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def has_priority(process: int, wanted: int) -> bool:
    """Whether a process has this niceness."""
    return os.getpriority(os.PRIO_PROCESS, process) == wanted


def test_a_call_that_nothing_prepared_does_not_compile(tmp_path: Path) -> None:
    """A behaviour in a test of a user's: no compiler, no file, and no choice, so that a team may still compile."""
    assert run("call_kernels(); show()", tmp_path / "cache") == "None 0 False\n"
    assert list(tmp_path.glob("cache/*")) == []


@pytest.mark.ci
def test_what_is_kept_is_used_unasked(kept_kernels: Path) -> None:
    """Also where no team runs; `prepare` compiles what is missing, after calls too."""
    assert run("call_kernels(); show(); prepare(KERNELS); call_kernels(); show()", kept_kernels) == (
        "None 0 False\nTrue 3 False\n"
    )
    assert run("call_kernels(); show()", kept_kernels) == "None 3 False\n"


@pytest.mark.ci
def test_a_choice_stays(kept_kernels: Path) -> None:
    """A process that was told to run plain does."""
    run("prepare(KERNELS)", kept_kernels)
    assert run("KERNELS.use_plain()\nwith run_kept(KERNELS): call_kernels()\nshow()", kept_kernels) == (
        "False 0 False\n"
    )


@pytest.mark.ci
def test_one_robot_compiles_for_the_next_start(kept_kernels: Path) -> None:
    """Two run plain, from an incomplete cache: one child completes it. Those that come later use it."""
    wait = "with run_kept(KERNELS):\n    call_kernels(); show(); sys.stdin.read(); call_kernels(); show()"
    with start(wait, kept_kernels) as first, start(wait, kept_kernels) as second:
        for robot in (first, second):
            assert robot.stdout is not None
            assert robot.stdout.readline() == "False 0 False\n"
        children = children_of(first) + children_of(second)
        assert len(children) == 1
        wait_until_true(lambda: list(kept_kernels.glob("complete-behaviors-*")))
        wait_until_true(lambda: not children_of(first) + children_of(second))
        for robot in (first, second):
            assert robot.communicate(timeout=LIMIT)[0] == "False 0 False\n"
    assert run(wait, kept_kernels) == "True 3 False\n" * 2


@pytest.mark.ci
@pytest.mark.parametrize("end", ["kill", "order"])
def test_what_compiles_ends_with_its_robot(tmp_path: Path, end: str) -> None:
    """However that ends. The next one compiles. All of it has a low priority."""
    lowest = os.getpriority(os.PRIO_PROCESS, 0) + 10
    for robot in (start("with run_kept(KERNELS): sys.stdin.read()", tmp_path) for _ in range(2)):
        try:
            wait_until_true(partial(children_of, robot))
            (child,) = children_of(robot)
            handle = os.pidfd_open(child)
            wait_until_true(partial(has_priority, child, lowest))
        finally:
            if end == "kill":
                robot.kill()
            robot.communicate(timeout=LIMIT)
        assert select.select([handle], [], [], LIMIT)[0]
        os.close(handle)
    assert not list(tmp_path.glob("complete-*"))


def test_without_a_cache_a_robot_runs_plain(tmp_path: Path) -> None:
    """It says nothing of it: nothing that a user would see is different."""
    (tmp_path / "file").touch()
    code = "with run_kept(KERNELS): call_kernels()\nshow()"
    assert run(code, tmp_path / "file" / "cache") == "False 0 False\n"


@pytest.mark.ci
def test_a_warm_parent_loads_kernels_before_it_forks(kept_kernels: Path) -> None:
    """Once it has read a robot's command line, all are loaded; from an incomplete cache none, and the robot decides."""
    code = "from zteam.cli import zteam_robot; zteam_robot.prepared(['--id', '0']); show()"
    assert run(code, kept_kernels) == "None 0 False\n"
    run("prepare(KERNELS)", kept_kernels)
    assert run(code, kept_kernels) == "True 3 False\n"


@pytest.mark.ci
def test_compile_only_compiles_the_robots_kernels_too(kept_kernels: Path) -> None:
    """As for an image: then nothing is compiled in it."""
    done = subprocess.run(
        zteam_command("zteam-sim", "office", "--compile-only"),
        env={**os.environ, "NUMBA_CACHE_DIR": str(kept_kernels)},
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 0
    assert [path.name.split("-")[1] for path in sorted(kept_kernels.glob("complete-*"))] == ["behaviors", "sim"]


WHERE = """
import importlib, sys
jit = importlib.import_module(sys.argv[1])
(kernels,) = [value for value in vars(jit).values() if type(value).__name__ == "KernelSet"]
importlib.import_module(kernels.warmup)
print(kernels.name, *{sys.modules[kernel.__module__].__file__ for kernel in kernels.kernels}, sep="\\n")
"""


@pytest.mark.parametrize("package", kernel_cache._PACKAGES)
def test_what_is_kept_hangs_on_the_code_of_each_kernel(package: str) -> None:
    """Else kernels of older code would run: a module with kernels lies in its package and declares them as others."""
    # In a process of its own: tests declare some too.
    command = [sys.executable, "-P", "-c", WHERE, f"zteam.{package}.jit"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=True)
    name, *files = done.stdout.splitlines()
    assert name == package
    assert files
    for path in map(Path, files):
        assert path.parent == Path(kernel_cache.__file__).parents[1] / package
        assert any(mark in path.read_bytes() for mark in kernel_cache._MARKS)
