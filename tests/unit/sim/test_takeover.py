"""A simulator without compiled kernels: it starts on numpy and switches while it runs, or logs why it cannot."""

import os
import select
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.transports import wait_until_true
from zteam.launch.process import zteam_command

TESTS = Path(__file__).resolve().parents[2]
RUN = """
import hashlib, logging, resource, sys
sys.path.insert(0, sys.argv[1])
logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
from support.small_worlds import drive, make_maze, make_robot
from zteam.compiling import takeover
from zteam.sim import Engine, Options, edge_kernels, jit
from zteam.sim.jit import SIMULATOR

def make_engine():
    robots = {i: make_robot(-0.6 + 0.6 * i, 0.1 * i, 0.7 * i) for i in range(3)}
    return Engine(make_maze(), robots=robots, options=Options(gaussian_noise=0.01))

def advance(engine, digest):
    seen = engine.step({i: drive(0.8, 0.5 * i - 0.5) for i in range(3)})
    for one in seen.robots.values():
        digest.update(repr((one.truth, one.odom, one.stall)).encode() + one.readings[0].ranges.tobytes())
"""


def start(code: str, folder: Path) -> "subprocess.Popen[str]":
    """A process of its own that runs RUN and `code`, with `folder` as its cache."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", RUN + textwrap.dedent(code), str(TESTS)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def run(code: str, folder: Path) -> list[str]:
    """Its lines."""
    process = start(code, folder)
    output, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, output
    return output.splitlines()


@pytest.mark.ci
def test_a_run_that_changes_over_gives_the_same_bytes(kept_kernels: Path) -> None:
    """Begun without compiled kernels, ended with them: poses, odometry and ranges are those of a compiled run."""
    code = """
        later = takeover.begin(SIMULATOR)
        engine, digest, ticks = make_engine(), hashlib.sha256(), 0
        advance(engine, digest)
        assert "numba" not in sys.modules, "the start waits for a compiler"
        later.start()
        while not later.wait(0.1):
            later.poll()
            advance(engine, digest)
            ticks += 1
        for _ in range(20):
            later.poll()
            advance(engine, digest)
        jit.use_compiled()
        other, expected = make_engine(), hashlib.sha256()
        for _ in range(21 + ticks):
            advance(other, expected)
        print(digest.hexdigest() == expected.hexdigest(), "numba" in sys.modules)
        """
    assert run(code, kept_kernels) == [
        "lasers run on numpy while their kernels are compiled, once on this machine",
        "compiled kernels take over",
        "True False",
    ]
    assert run("print(takeover.begin(SIMULATOR), 'numba' in sys.modules)", kept_kernels) == ["None False"]


@pytest.mark.ci
def test_what_compiles_ends_with_its_simulator_and_keeps_what_it_finished(tmp_path: Path) -> None:
    """A simulator killed by SIGKILL leaves no process, but the first kernel is in the cache."""
    process = start("later = takeover.begin(SIMULATOR); later.start(); later.wait(1000.0)", tmp_path)
    try:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        wait_until_true(children.read_text)
        child = int(children.read_text())
        handle = os.pidfd_open(child)
        wait_until_true(lambda: list(tmp_path.glob("*/fields._fill_squares*.nbc")))
        assert os.getpriority(os.PRIO_PROCESS, child) == os.getpriority(os.PRIO_PROCESS, 0) + 10
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert select.select([handle], [], [], LIMIT)[0]
    os.close(handle)
    assert list(tmp_path.glob("*/fields._fill_squares*.nbi"))
    assert not list(tmp_path.glob("complete-*"))


def test_a_simulator_goes_on_without_a_cache_that_cannot_be_written(tmp_path: Path) -> None:
    """One warning that names the folder; nothing is compiled, and nothing is left beside the source."""
    (tmp_path / "file").touch()
    code = """
        later = takeover.begin(SIMULATOR)
        advance(make_engine(), hashlib.sha256())
        advance(make_engine(), hashlib.sha256())
        print(later, "numba" in sys.modules)
        """
    warning, rest = run(code, tmp_path / "file" / "cache")
    assert str(tmp_path / "file" / "cache") in warning
    assert "Not a directory" in warning
    assert rest == "None False"


def test_a_simulator_starts_where_no_disk_takes_a_byte(tmp_path: Path) -> None:
    """Neither a cache folder nor a temporary one: one warning that says so, and the run begins on numpy."""
    (tmp_path / "file").touch()
    code = f"""
        import os
        os.environ.pop("NUMBA_CACHE_DIR")
        os.environ["XDG_CACHE_HOME"] = {str(tmp_path / "file")!r}
        os.environ["TMPDIR"] = {str(tmp_path / "file")!r}
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
        for name in [name for name in sys.modules if name.startswith(("zteam", "scenes"))]:
            del sys.modules[name]
        from zteam.compiling import takeover
        from zteam.sim.jit import SIMULATOR
        print(takeover.begin(SIMULATOR))
        """
    warning, rest = run(code, tmp_path)
    assert "neither the cache folder nor the temporary one can be written" in warning
    assert rest == "None"


@pytest.mark.ci
def test_a_simulator_goes_on_without_a_cache_that_is_full(tmp_path: Path) -> None:
    """What compiles cannot keep the first kernel: one warning, and the run stays on numpy."""
    code = """
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))
        later = takeover.begin(SIMULATOR)
        later.start()
        engine = make_engine()
        while not later.wait(0.1):
            advance(engine, hashlib.sha256())
            later.poll()
        print("numba" in sys.modules)
        """
    _, warning, rest = run(code, tmp_path)
    assert f"{tmp_path}: File too large; lasers run on numpy" in warning
    assert rest == "False"


def test_compile_only_fails_where_nothing_can_be_kept(tmp_path: Path) -> None:
    """An image must not be built without a cache: exit code 1 and one line that names the folder."""
    (tmp_path / "file").touch()
    done = subprocess.run(
        zteam_command("zteam-sim", "office", "--compile-only"),
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "file" / "cache")},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert str(tmp_path / "file" / "cache") in line


@pytest.mark.ci
@pytest.mark.parametrize("folder", ["full", "file/missing"])
def test_a_kernel_that_cannot_be_kept_is_compiled_in_memory(tmp_path: Path, folder: str) -> None:
    """In a run that does not start on numpy, too, a full or unwritable folder costs one warning and nothing else."""
    (tmp_path / "file").touch()
    code = """
        import numpy as np
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))
        jit.use_compiled()
        out, bright = np.zeros((2, 1, 3), np.float32)
        for _ in range(2):
            edge_kernels.finish(np.full((1, 3), 2.0), np.zeros((1, 3), np.int32), np.ones(1, np.float32), out, bright)
        print(out.tolist(), bright.tolist())
        """
    warning, rest = run(code, tmp_path / folder)
    assert "compiling anew in memory" in warning
    assert rest == "[[2.0, 2.0, 2.0]] [[1.0, 1.0, 1.0]]"
