"""When a robot's localisation is lost, for all that say so.

The limits are twice the standard deviations that Nav2's amcl begins with where its user has only clicked a place, 0.5 m
and pi/12 (`initial_cov_xx`, `initial_cov_aa`, and "2D Pose Estimate" of RViz): a robot with a larger error is somewhere
else.
"""

import math

LOST_DEVIATION = 1.0
"""Metres: standard deviation of its own estimate along an axis."""
LOST_DISTANCE = 1.0
"""Metres from where it takes itself to be to where it is."""
LOST_TURN = math.pi / 6
"""Radians between both headings."""
