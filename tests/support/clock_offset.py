"""A library that gives processes another real-time clock."""

import shutil
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT


def build_clock(folder: Path) -> Path:
    """The library of clock_offset.c, to be preloaded. Skips the test without a C compiler."""
    compiler, library = shutil.which("cc"), folder / "clock_offset.so"
    if compiler is None:
        pytest.skip("no C compiler makes the library of another clock")
    source = Path(__file__).with_suffix(".c")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True, timeout=LIMIT)
    return library
