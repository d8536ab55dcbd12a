"""Makes the tests' own modules importable, in xdist workers too, and gives all tests the same surroundings."""

import fcntl
import gc
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

import support.examples  # noqa: F401 - its profile is that of all property tests
from support.adopted import check_adopted

# A message that is handed over is not checked otherwise.
check_adopted()

# Under nohup, or as a shell's background job, pytest ignores these signals, and so would every process of a test that
# is about them.
if threading.current_thread() is threading.main_thread():
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


CI_FOLDERS = ("tests/bench/", "tests/team/")
FOLDERS = {
    "proof": "teams of processes, as a user starts them",
    "golden": "recordings of Stage and tf2 come out again",
    "unit": "each part by itself",
}
"""What the default run runs."""
PROVES = "proves"
"""Key of a report's property: the title of a file of tests/proof, and the sentence of the test."""
ONLY_CI = """only .ci/full proves (README, "Tests"):
  tests/team, tests/bench: everything else that teams do, each failure of a process, speed as ratios
  tests/property: what holds for whatever is drawn; tests marked `ci`; the page in a browser and its JavaScript
  a wheel, containers, each Python from 3.11 to 3.13, style, types, layers"""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect without the garbage collector, which then leaves out the thousands of tests: a third less time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what README's command leaves out, and note what each proof proves."""
    sweeps: dict[tuple[Path, str], list[pytest.Item]] = {}
    for item in items:
        if item.nodeid.startswith(CI_FOLDERS) or item.get_closest_marker("gate"):
            item.add_marker("ci")
        if item.get_closest_marker("few") and isinstance(item, pytest.Function) and not item.get_closest_marker("ci"):
            sweeps.setdefault((item.path, item.originalname), []).append(item)
        if item.nodeid.startswith("tests/proof/") and isinstance(item, pytest.Function):
            texts = (item.module.__doc__, item.function.__doc__)
            item.user_properties.append((PROVES, [(text or "").strip().rstrip(".") for text in texts]))
    for cases in sweeps.values():
        count = min(len(cases), cases[0].get_closest_marker("few").args[0])  # type: ignore[union-attr]
        taken = {(2 * k + 1) * len(cases) // (2 * count) for k in range(count)}
        for index, item in enumerate(cases):
            if index not in taken:
                item.add_marker("ci")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """After the default run, say what it proved, and what only `.ci/full` proves."""
    if config.args_source != pytest.Config.ArgsSource.TESTPATHS:
        return
    passed, failed, errors = (terminalreporter.stats.get(kind, []) for kind in ("passed", "failed", "error"))
    proved: dict[str, dict[str, None]] = {}
    for title, sentence in sorted(value for report in passed for key, value in report.user_properties if key == PROVES):
        proved.setdefault(title, {})[sentence] = None
    for report in (*failed, *errors):
        # That of a file that cannot be collected has none.
        properties = getattr(report, "user_properties", ())
        for title, sentence in (value for key, value in properties if key == PROVES):
            proved.get(title, {}).pop(sentence, None)
    terminalreporter.section("what this run proved")
    for title, sentences in proved.items():
        terminalreporter.line(f"{title}:" if sentences else f"{title}: nothing")
        for sentence in sentences:
            terminalreporter.line(f"  {sentence}")
    for folder, what in FOLDERS.items():
        count = sum(report.nodeid.startswith(f"tests/{folder}/") for report in passed)
        terminalreporter.line(f"tests/{folder}: {count} passed ({what})")
    terminalreporter.line(ONLY_CI)


@pytest.fixture(autouse=True)
def one_real_time_test(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test in real time runs while no other one does on this machine: they would take each other's time.

    The lock is on the folder of temporary files, so that it leaves no file.
    """
    if request.node.get_closest_marker("real_time") is None:
        yield
        return
    folder = os.open(tempfile.gettempdir(), os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


@pytest.fixture
def team(request: pytest.FixtureRequest, team: Any) -> Any:
    """The plugin's fixture; in the second case of a test with BOTH_PACES in real time."""
    if getattr(request, "param", "") == "real time":
        from support.paces import RealTimeTeam

        # The very object whose logs the plugin shows, and which it closes.
        team.__class__ = RealTimeTeam
    return team


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> object:
    """A team in real time calls its test: it may call it twice."""
    run_test = getattr(pyfuncitem.funcargs.get("team"), "run_test", None)
    return None if run_test is None else run_test(pyfuncitem)


@pytest.fixture
def own_types() -> Iterator[None]:
    """Message types that the test defines are forgotten at its end."""
    from zteam.messages.message import REGISTERED, import_offered

    before = dict(REGISTERED)
    import_offered.cache_clear()
    yield
    REGISTERED.clear()
    REGISTERED.update(before)
    import_offered.cache_clear()


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
