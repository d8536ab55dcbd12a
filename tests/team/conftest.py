"""A plain Zenoh client for the tests of teams, and a second team."""

from collections.abc import Iterator

import pytest
import zenoh

from zteam.bus.options import BusOptions, client_config
from zteam.team.testing.team import TeamFixture


@pytest.fixture
def outsider(team: TeamFixture) -> Iterator[zenoh.Session]:
    """A session outside the team's namespace, as a program without zteam would open it."""
    config = client_config(BusOptions(connect=team.endpoint))
    # As a plain client does whose answers count (docs/time.md).
    config.insert_json5("timestamping/enabled", "true")
    session = zenoh.open(config)
    yield session
    session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def same_team() -> Iterator[TeamFixture]:
    """Another team, such as the same one in this process."""
    team = TeamFixture()
    yield team
    team.close()
