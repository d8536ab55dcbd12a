"""Makes the tests' own modules importable, in xdist workers too, and gives all tests the same surroundings."""

import os
import shutil
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from zteam.compiling import kernels
from zteam.messages import sharing

# Speed is the machine's business, not a test's: a slow example is no failure.
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")

# pytester gives the runs it starts a home of their own, where the simulator would compile its kernels once more.
os.environ.setdefault("XDG_CACHE_HOME", str(Path.home() / ".cache"))

# A kernel that is called with other types than it was compiled for would compute nonsense.
kernels.check_types()
# A message that is handed over is not checked otherwise.
sharing.check_adopted()

# Under nohup, or as a shell's background job, pytest ignores these signals, and so would every process of a test that
# is about them.
if threading.current_thread() is threading.main_thread():
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def own_types() -> Iterator[None]:
    """Message types that the test defines are forgotten at its end."""
    from zteam.messages import registry
    from zteam.messages.message import REGISTERED

    before = dict(REGISTERED)
    registry._offered_type.cache_clear()
    yield
    REGISTERED.clear()
    REGISTERED.update(before)
    registry._offered_type.cache_clear()


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_types: None) -> Iterator[Path]:
    """An empty folder in which the test stands. What is imported from it is forgotten at the end."""
    known = set(sys.modules)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in set(sys.modules) - known:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.fixture
def kept_kernels(tmp_path: Path) -> Path:
    """A cache that holds all kernels but does not say so, as one whose compiling ended just before its end."""
    from zteam.behaviors.jit import BEHAVIOR_KERNELS
    from zteam.compiling import kernel_cache, takeover
    from zteam.sim.jit import SIMULATOR

    assert kernel_cache.FOLDER is not None
    for kernel_set in (SIMULATOR, BEHAVIOR_KERNELS):
        # What ran before in this process may have made its choice without a look at the cache.
        takeover.fill_cache(kernel_set)
        assert kernel_cache.is_complete(kernel_set.name), "this machine's cache cannot be filled"
    shutil.copytree(kernel_cache.FOLDER, tmp_path / "cache", ignore=shutil.ignore_patterns("complete-*"))
    return tmp_path / "cache"
