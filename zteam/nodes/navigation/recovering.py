"""What a robot does that does not get on, in both costmaps, and when that has helped."""

import math

from zteam.geometry import Pose2
from zteam.nodes.navigation.costmaps import Costmaps
from zteam.nodes.navigation.way import Moment
from zteam.planning.parameters import Parameters
from zteam.planning.recovery import Recovery, RecoveryStep

_IN_VAIN = 3
"""Times `number_of_retries`: so many recoveries may bring a robot no nearer to its goal, wherever it moves."""


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
        self._from: Pose2 | None = None
        """Where the robot was when it began to recover, until it has moved on from there."""
        self._least = math.inf
        """Metres to the goal when it began to recover, until it has got nearer."""
        self._in_vain = 0
        """Recoveries since the robot last got nearer to its goal."""

    def begin(self, moment: Moment, left: float, reason: str) -> str | None:
        """Begin the next one, or return why the goal is given up. `left`: metres to the goal."""
        if self._in_vain >= _IN_VAIN * self._options.number_of_retries > 0:
            return f"{reason}: gave up after {self._in_vain} recoveries that brought it no nearer to the goal"
        pose = moment.sight.pose
        end = self._recovery.begin(moment.now, pose, reason)
        if end is None:
            self.count, self._in_vain = self.count + 1, self._in_vain + 1
            self._from, self._least = self._from or pose, min(self._least, left)
        return end

    def step(self, moment: Moment, costmaps: Costmaps) -> RecoveryStep:
        """What to do now."""
        options, pose = self._options, moment.sight.pose
        clears = options.behaviors[(self._recovery.count - 1) % len(options.behaviors)] == "clear_costmap"
        step = self._recovery.step(moment.now, pose, costmaps.local, is_stopped=moment.is_stopped)
        if clears:
            costmaps.clear_around(pose, options.clear_distance)
        return step

    def note_progress(self, pose: Pose2, left: float) -> None:
        """The robot is at `pose`, `left` metres from its goal: after a recovery that helped, all may be tried again.

        To have moved is enough a few times only: a robot that backs up and comes back has moved.
        """
        if self._from is not None and math.dist(pose[:2], self._from[:2]) > self._enough:
            self._recovery.reset()
            self._from = None
        if left < self._least - self._enough and self._in_vain:
            self._least, self._in_vain = math.inf, 0
