"""When a robot in real time acts: once for each scan, and again while no scan comes."""

from zteam.clock import to_ns
from zteam.nodes.robot.driver import Driver, Turn
from zteam.nodes.robot.inputs import Inputs
from zteam.runtime.lockstep import Participant
from zteam.runtime.process_node import ProcessNode

STALE = to_ns(0.5)
"""Age of the newest scan (simulated ns) from which on the robot acts without a new one, to stop."""
TF_PATIENCE = 0.02
"""Host seconds to wait for the transforms of a scan's own tick: they come over the aggregator, one hop later. By the
host's clock, because simulated time stands still within a tick; a next scan ends the wait as well."""


class ScanPacing:
    """Says when the next turn is due. All methods are called under `node.changed`."""

    def __init__(self, node: ProcessNode, inputs: Inputs, driver: Driver, part: Participant) -> None:
        self._node = node
        self._inputs = inputs
        self._driver = driver
        self._part = part
        self.acted = 0
        """Stamp of the scan that was acted on last."""
        self._expects_tf = False
        """Whether the transforms of the last scan's tick came in time."""

    def is_due(self) -> bool:
        """Whether there is a reason to act in real time."""
        return not self._part.active and (self._has_complete_scan() or self._data_stopped())

    def begin_turn(self) -> Turn | None:
        """The turn that is due, once its transforms have come; None if there is none. May wait without the lock."""
        if self._part.active or not (self._has_new_scan() or self._data_stopped()):
            return None
        now = self._node.clock.now()
        if self._has_new_scan():
            self.acted = self._inputs.scan_stamp
            # A scan that was held up on its way is as old as the clock says.
            now = max(self.acted, now)
            self._inputs.base_input.wait_no_longer()
        if self._driver.behavior.uses_tf and not self._wait_for_transforms(now):
            return None
        turn = self._driver.turn(now, self._inputs.go_epoch(now))
        self._driver.stepped = now
        return turn

    def _has_new_scan(self) -> bool:
        """Whether a scan has come that was not acted on."""
        return self._inputs.scan is not None and self._inputs.scan_stamp != self.acted

    def _has_complete_scan(self) -> bool:
        """Whether a new scan has come, and its tick's transforms if those usually come in time."""
        inputs = self._inputs
        return self._has_new_scan() and (not self._expects_tf or inputs.tf_stamp >= inputs.scan_stamp)

    def _data_stopped(self) -> bool:
        """Whether time went on for STALE without a scan, and for a fifth of that since the last step."""
        now = self._node.clock.now()
        return now - self.acted > STALE and now - self._driver.stepped >= STALE // 5

    def _wait_for_transforms(self, now: int) -> bool:
        """Release the lock until the transforms of `now` come; False if the turn is void when it is taken again."""
        inputs, jumps = self._inputs, self._driver.jumps
        scan = inputs.scan
        # Once they stay away, the next scan wakes the main loop without them.
        self._expects_tf = self._node.wait(lambda: inputs.tf_stamp >= now or inputs.scan is not scan, TF_PATIENCE)
        return self._driver.jumps == jumps and not self._part.active and not self._node.stopping
