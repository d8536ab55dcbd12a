"""The simulator's core: pure, no bus, no clock. Importing this package does not import pymunk."""

from zteam.config.simulation_options import Options
from zteam.simulator.core.engine import Engine
from zteam.simulator.core.lasers import Reading
from zteam.simulator.core.observation import Observation, RobotObservation

__all__ = ["Engine", "Observation", "Options", "Reading", "RobotObservation"]
