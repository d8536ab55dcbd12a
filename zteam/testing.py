"""Tests of teams, nodes and behaviours.

The pytest fixture `team` starts a whole team of real processes, and `team_module` and `team_session` start one that
many tests share; `Team` is their type, for annotations. They raise `TeamFailure` and `TeamTimeout`. `run_node` runs one
node of your own in the test's process on a `MemoryHub`, `make_view` makes what a behaviour sees, and `find_faults`
returns what `zteam check` finds wrong.
"""

import importlib

# Not typing's own: `make_view` does not pay for it.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from zteam.bus import MemoryHub
    from zteam.robot.trials.check import find_faults
    from zteam.team.testing.in_memory import RunningNode, make_view, run_node
    from zteam.team.testing.team import TeamFixture as Team
    from zteam.team.testing.watch import TeamFailure, TeamTimeout

__all__ = ["MemoryHub", "RunningNode", "Team", "TeamFailure", "TeamTimeout", "find_faults", "make_view", "run_node"]

_HOMES = {
    "MemoryHub": "zteam.bus",
    "Team": "zteam.team.testing.team",
    "TeamFailure": "zteam.team.testing.watch",
    "TeamTimeout": "zteam.team.testing.watch",
    "find_faults": "zteam.robot.trials.check",
}
"""Where these are; the rest is in `in_memory`."""


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'zteam.testing' has no attribute {name!r}")
    module = importlib.import_module(_HOMES.get(name, "zteam.team.testing.in_memory"))
    return getattr(module, "TeamFixture" if name == "Team" else name)


def __dir__() -> list[str]:
    return __all__
