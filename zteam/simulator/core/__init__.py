"""The simulator's core: pure, no bus, no clock. Importing this package does not import pymunk."""

from zteam.config.simulation_options import Options
from zteam.simulator.core.engine import Engine, Observation, RobotObservation
from zteam.simulator.core.lasers import Reading

__all__ = ["Engine", "Observation", "Options", "Reading", "RobotObservation"]
