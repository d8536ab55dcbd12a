"""Watches the steps of a behaviour: how long they take, and whether they look up what is not declared."""

import logging
import sys
from types import CodeType

from zteam.behaviors import Behavior, View
from zteam.geometry import Pose2
from zteam.nodes.robot.inputs import Inputs
from zteam.runtime.step_watch import StepWatch

log = logging.getLogger("zteam")

_TEAMMATES: CodeType = vars(View)["teammates"].func.__code__


def watch_steps(behavior: Behavior, spec: str, inputs: Inputs) -> StepWatch:
    """A watch on the steps of `behavior`, which was started as `spec`."""
    watch = StepWatch(f"{type(behavior).__name__}.step", "a scan comes every", f"try zteam check {spec}")
    if not behavior.uses_tf:
        _name_look_ups(inputs, behavior, watch)
    return watch


def _name_look_ups(inputs: Inputs, behavior: Behavior, watch: StepWatch) -> None:
    """Have the log say once if a step looks transforms up: it would drive on by old ones."""
    find_pose, name = inputs.lookup, type(behavior).__name__

    def lookup(target_frame: str, source_frame: str) -> tuple[Pose2, int] | None:
        # Teammates come with their age, and the safety layer looks when the step is over.
        if watch.is_under_way and not behavior.uses_tf and sys._getframe(2).f_code is not _TEAMMATES:
            inputs.lookup = find_pose
            log.warning("%s looks transforms up without 'uses_tf = True': it would drive on by old ones", name)
        return find_pose(target_frame, source_frame)

    inputs.lookup = lookup
