"""The pytest plugin with the fixtures `team`, `team_module` and `team_session`.

Every pytest run on a machine with zteam loads this module, so it imports nothing of zteam until a test asks for a team.
"""

import os
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from zteam.team.testing.team import SharedTeam, TeamFixture

_TEAMS = pytest.StashKey[dict[str, "TeamFixture"]]()
"""Of the session: the teams by the names of their fixtures."""
_FAILED = pytest.StashKey[bool]()
"""Of a test: whether some part of it has failed."""
_HERE = str(Path(__file__).parent) + os.sep
_ZTEAM = str(Path(__file__).parents[2]) + os.sep


def _give(request: pytest.FixtureRequest) -> Iterator[Any]:
    from zteam.team.testing.team import SharedTeam, TeamFixture

    is_own, config = request.scope == "function", request.config
    teams, chosen = request.session.stash.setdefault(_TEAMS, {}), config.getoption("zteam_record") if is_own else None

    def folder() -> Path:
        if chosen is None:
            factory: pytest.TempPathFactory = request.getfixturevalue("tmp_path_factory")
            return Path(factory.mktemp("recording"))
        made: Path = config.invocation_params.dir / chosen
        made.mkdir(parents=True, exist_ok=True)
        return made

    fixture = (TeamFixture if is_own else SharedTeam)(
        config.rootpath,
        live=config.getoption("capture") == "no",
        test=request.node.nodeid,
        folder=folder,
        records=chosen is not None,
    )
    teams[str(request.fixturename)] = fixture
    try:
        yield fixture
    finally:
        fixture.close()
        del teams[str(request.fixturename)]
        if chosen is not None and not request.node.stash.get(_FAILED, False):
            fixture.recording.unlink(missing_ok=True)


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--zteam-record`."""
    text = "record the team of each test, and keep the recordings of those that fail (default folder: recordings)"
    parser.getgroup("zteam").addoption("--zteam-record", nargs="?", const="recordings", metavar="FOLDER", help=text)


@pytest.fixture
def team(request: pytest.FixtureRequest) -> Iterator["TeamFixture"]:
    """A team with its own router and namespace, or in this process; it ends with the test, also when the test fails."""
    yield from _give(request)


@pytest.fixture(scope="module")
def team_module(request: pytest.FixtureRequest) -> Iterator["SharedTeam"]:
    """One team for the tests of a module: what `start` or `launch` has started is started anew for each test."""
    yield from _give(request)


@pytest.fixture(scope="session")
def team_session(request: pytest.FixtureRequest) -> Iterator["SharedTeam"]:
    """As `team_module`, for all tests of the run."""
    yield from _give(request)


def _teams(item: pytest.Item) -> "list[TeamFixture]":
    teams, used = item.session.stash.get(_TEAMS, {}), getattr(item, "fixturenames", ())
    return [fixture for name, fixture in teams.items() if name in used]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Start the teams anew that an earlier test has used."""
    for fixture in _teams(item):
        if hasattr(fixture, "put_back"):
            _call(fixture.put_back)
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test that has come to its end with a process of its team that ended or hangs unasked."""
    result = yield
    for fixture in _teams(item):
        _call(fixture.check_at_end)
    return result


class _Told(pytest.fail.Exception):  # type: ignore[misc,name-defined]
    """A failure that no line of the test has raised."""


def _call(check: Callable[[], None]) -> None:
    """Fail the test with the reason alone."""
    from zteam.errors import ZteamError

    try:
        check()
    except ZteamError as error:
        raise _Told(str(error), pytrace=False) from None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Show the reason of a failure first, and add the logs of all processes of the team."""
    errors, value = sys.modules.get("zteam.errors"), call.excinfo and call.excinfo.value
    if errors is not None and value is not None:
        _hide_library(value, errors.ZteamError)
    report = yield
    crash = getattr(report.longrepr, "reprcrash", None)
    if errors is not None and isinstance(value, (errors.ZteamError, _Told)) and crash is not None:
        # Without the type the short summary has room for the reason.
        crash.message = str(value)
    if report.failed:
        item.stash[_FAILED] = True
        for fixture in _teams(item):
            report.sections.append(("processes of the team", fixture.report_log()))
            if item.config.getoption("zteam_record") is not None and fixture.recording.exists():
                report.sections.append(("recording of the team", str(fixture.recording)))
    return report


def _hide_library(error: BaseException | None, told: type[BaseException]) -> None:
    """Hide the frames of the fixtures from pytest; all of zteam's where it is an error that zteam has `told`."""
    while error is not None:
        for frame, _ in walk_tb(error.__traceback__):
            file = frame.f_code.co_filename
            if file.startswith(_ZTEAM) and file != __file__:
                hides = file.startswith(_HERE) or (lambda info: isinstance(info.value, told))
                frame.f_globals["__tracebackhide__"] = hides
        error = error.__cause__ or error.__context__


def pytest_unconfigure() -> None:
    """End what the teams of this run had in common."""
    session = sys.modules.get("zteam.team.testing.team")
    if session is not None:
        session.WARM_PARENT.close()
