"""The pytest plugin with the `team` fixture.

Every pytest run on a machine with zteam loads this module, so it imports nothing of zteam until a test asks for a team.
"""

import sys
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from zteam.team.testing.team import TeamFixture

_TEAM = pytest.StashKey["TeamFixture"]()


@pytest.fixture
def team(request: pytest.FixtureRequest) -> Iterator["TeamFixture"]:
    """A team with its own router and namespace, or in this process; it ends with the test, also when the test fails."""
    from zteam.team.testing.team import TeamFixture

    fixture = TeamFixture(request.config.rootpath)
    request.node.stash[_TEAM] = fixture
    try:
        yield fixture
    finally:
        fixture.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test that has come to its end with a process of its team that ended or hangs unasked."""
    result = yield
    fixture = item.stash.get(_TEAM, None)
    if fixture is not None:
        fixture.check_at_end()
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the logs of all processes of the team to the report of a failed test."""
    report = yield
    fixture = item.stash.get(_TEAM, None)
    if fixture is not None and report.failed:
        report.sections.append(("processes of the team", fixture.report_log()))
    return report


def pytest_unconfigure() -> None:
    """End what the teams of this run had in common."""
    session = sys.modules.get("zteam.team.testing.processes")
    if session is not None:
        session.WARM_PARENT.close()
