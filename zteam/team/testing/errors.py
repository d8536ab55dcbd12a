"""The failures of a test of a team."""

from zteam.errors import ZteamError


class TeamFailure(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A process of the team has ended or hangs, and the test did not ask for that."""

    # Where users import it from; a summary has little room.
    __module__ = "zteam.testing"


class TeamTimeout(TeamFailure):
    """A condition did not come true in time."""

    __module__ = "zteam.testing"
