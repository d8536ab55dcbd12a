"""What a robot does that does not get on, in both costmaps, and when that has helped."""

import math

from zteam.nodes.navigation.costmaps import Costmaps
from zteam.nodes.navigation.way import Moment
from zteam.planning.parameters import Parameters
from zteam.planning.recovery import Recovery, RecoveryStep


class Recovering:
    """The recoveries of one goal after the other."""

    def __init__(self, parameters: Parameters) -> None:
        self._options = parameters.recovery
        self._enough = parameters.progress.required_movement_radius
        self._recovery = Recovery(self._options)
        self.forget()

    def forget(self) -> None:
        """Another goal."""
        self._recovery.reset()
        self.count = 0
        """Recoveries for this goal."""
        self._least = math.inf
        """Metres to the goal when it began to recover, until it has got nearer."""

    def begin(self, moment: Moment, left: float, reason: str) -> str | None:
        """Begin the next one, or return why the goal is given up. `left`: metres to the goal."""
        end = self._recovery.begin(moment.now, moment.sight.pose, reason)
        if end is None:
            self.count += 1
            self._least = min(self._least, left)
        return end

    def step(self, moment: Moment, costmaps: Costmaps) -> RecoveryStep:
        """What to do now."""
        options, pose = self._options, moment.sight.pose
        clears = options.behaviors[(self._recovery.count - 1) % len(options.behaviors)] == "clear_costmap"
        step = self._recovery.step(moment.now, pose, costmaps.local)
        if clears:
            costmaps.clear_around(pose, options.clear_distance)
        return step

    def note_progress(self, left: float) -> None:
        """After a recovery that helped, all of them may be tried again: the robot is nearer to its goal than before.

        To have moved is not enough: a robot that backs up and comes back has moved.
        """
        if left < self._least - self._enough and self._least < math.inf:
            self._recovery.reset()
            self._least = math.inf
