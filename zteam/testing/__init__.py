"""Tests of teams, nodes and behaviours.

The pytest fixture `team` starts a whole team of real processes; `Team` is its type, for annotations. `run_node` runs
one node of your own in the test's process on a `MemoryHub`, `make_view` makes what a behaviour sees, and `find_faults`
tells what `zteam check` finds wrong.
"""

# Not typing's own: every pytest run on a machine with zteam imports this module.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from zteam.bus import MemoryHub
    from zteam.testing.in_memory import RunningNode, make_view, run_node
    from zteam.testing.team import TeamFixture as Team
    from zteam.trials.check import find_faults

__all__ = ["MemoryHub", "RunningNode", "Team", "find_faults", "make_view", "run_node"]


def __getattr__(name: str) -> object:
    if name == "MemoryHub":
        from zteam.bus import MemoryHub

        return MemoryHub
    if name == "Team":
        from zteam.testing.team import TeamFixture

        return TeamFixture
    if name == "find_faults":
        from zteam.trials.check import find_faults

        return find_faults
    if name in __all__:
        from zteam.testing import in_memory

        return getattr(in_memory, name)
    raise AttributeError(f"module 'zteam.testing' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
