"""Kernels compiled by numba, and the cache that they are kept in."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT

CODE = """
import resource, sys
sys.path.insert(0, {folder!r})
if sys.argv[1:]:
    # As on a disk without room: no file of this process grows beyond so many bytes.
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
import logging
logging.basicConfig(stream=sys.stderr, format="%(message)s")
import two_kernels
print(two_kernels.add(1.0, 2.0), two_kernels.double(4.0))
"""
KERNELS = """
from zteam.sim.jit import compiled, vectorized

@compiled
def add(a, b):
    return a + b

@vectorized
def double(a):
    return 2.0 * a
"""


def use_kernels(folder: Path, *sizes: str) -> "subprocess.CompletedProcess[str]":
    """Two kernels compiled and called in a process of its own."""
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    (folder / "two_kernels.py").write_text(KERNELS)
    return subprocess.run(
        [sys.executable, "-B", "-P", "-c", CODE.format(folder=str(folder)), *sizes],
        env={**environment, "XDG_CACHE_HOME": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=3 * LIMIT,
        check=False,
    )


@pytest.mark.ci
@pytest.mark.parametrize("size", ["0", "100"])
def test_without_room_for_a_cache_the_kernels_work(tmp_path: Path, size: str) -> None:
    """A disk that is full, or nearly so, is told once; nothing is kept, and the kernels are right."""
    pytest.importorskip("numba")
    done = use_kernels(tmp_path, size)
    assert (done.returncode, done.stdout) == (0, "3.0 8.0\n"), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert "going on without a cache" in done.stderr
    assert list(tmp_path.rglob("*.nbc")) == []


@pytest.mark.ci
def test_with_room_the_kernels_are_kept(tmp_path: Path) -> None:
    """The cache holds both, and nothing is said."""
    pytest.importorskip("numba")
    done = use_kernels(tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "3.0 8.0\n", "")
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 2
