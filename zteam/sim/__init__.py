"""The simulator's core: pure, no bus, no clock. Importing this package does not import pymunk."""

from zteam.sim.engine import Engine
from zteam.sim.lasers import Reading
from zteam.sim.observation import Observation, RobotObservation
from zteam.simulation_options import Options

__all__ = ["Engine", "Observation", "Options", "Reading", "RobotObservation"]
