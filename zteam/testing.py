"""The public names of tests of teams, nodes and behaviours (`zteam.team.testing`)."""

from zteam.team import testing as _home
from zteam.team.testing import __all__ as __all__

# Not typing's own: `make_view` does not pay for it.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from zteam.team.testing import *  # noqa: F403


def __getattr__(name: str) -> object:
    return getattr(_home, name)


def __dir__() -> list[str]:
    return __all__
