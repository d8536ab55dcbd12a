"""The simulator's core: pure, no bus, no clock. Importing this package does not import pymunk."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from zteam.sim.engine import Engine, Observation, Options, Reading, RobotObservation

__all__ = ["Engine", "Observation", "Options", "Reading", "RobotObservation"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'zteam.sim' has no attribute {name!r}")
    from zteam.sim import engine

    return getattr(engine, name)
