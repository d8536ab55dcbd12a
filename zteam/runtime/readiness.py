"""The robot's side of the start gate, without a bus: BOOT until it has all its data, READY until GO, then RUNNING."""

from collections.abc import Sequence

from zteam.messages import RobotState


class Readiness:
    """State and reason of one robot. GO is never taken back."""

    def __init__(self, *, gated: bool, way_out: str = "zteam-monitor; --no-gate drives at once") -> None:
        """Without `gated` the robot drives at once. `way_out` is what a user may do while the robot waits for GO."""
        self._way_out = way_out
        self.released = not gated
        """Whether the robot may drive."""
        self.state: int = RobotState.BOOT
        self.reason = ""
        """Why it is in this state; empty if there is nothing to say."""
        self.epoch = 0
        """The GO that the robot obeys; 0 = none."""

    @property
    def is_ready(self) -> bool:
        """What the robot tells the monitor."""
        return self.state in (RobotState.READY, RobotState.RUNNING)

    def take(self, missing: Sequence[str], epoch: int) -> bool:
        """Take what the robot lacks and the GO that holds (0 = none); whether the robot may drive now."""
        if self.released:
            self.epoch = max(epoch, self.epoch)
        elif missing:
            self.state, self.reason = RobotState.BOOT, "waiting for " + ", ".join(missing)
        elif not epoch:
            self.state = RobotState.READY
            self.reason = f"waiting for the monitor's GO ({self._way_out})"
        else:
            self.released, self.epoch = True, epoch
        return self.released

    def drive(self, reason: str, epoch: int = 0) -> None:
        """The robot acts; `reason` says why it stands still, if it does; `epoch` is the GO that holds (0 = none)."""
        self.state, self.reason, self.epoch = RobotState.RUNNING, reason, max(epoch, self.epoch)

    def stop(self) -> None:
        """The process ends."""
        self.state, self.reason = RobotState.STOPPED, "stopped"
