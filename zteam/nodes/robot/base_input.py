"""What the robot knows of its base: `base_info`, the team file's override, and what holds without either."""

import logging

from zteam import names
from zteam.base import DEFAULT_BASE, BaseOverride, base_of, override_base
from zteam.clock import monotonic
from zteam.messages import BaseInfo

log = logging.getLogger("zteam")

PATIENCE = 2.0
"""Host seconds from its first scan on for which a robot in real time waits for `base_info`. The simulator publishes it
before the first scan; a base that does not publish it never will."""


class BaseInput:
    """The base of robot `robot_id`; `override` holds instead of what `base_info` tells."""

    def __init__(self, robot_id: int, override: BaseOverride) -> None:
        self._key = names.robot_key(robot_id, names.BASE_INFO)
        self._override = override
        self.base = override_base(DEFAULT_BASE, override)
        """DEFAULT_BASE and the override until `base_info` has come."""
        self.has_come = False
        """Whether `base_info` has come."""
        self._given_up = False
        self._waits_since = 0.0
        """Host time of the first scan in real time; 0 before."""

    def take(self, message: BaseInfo) -> None:
        """`base_info` has come: the first one, or another one because the base has changed."""
        self.base = override_base(base_of(message), self._override)
        self.has_come = True

    def missing(self) -> list[str]:
        """`base_info` as a noun for the robot's status, while it has to come before the robot is ready."""
        return [] if self.has_come or self._given_up else [f"its footprint ({self._key})"]

    def wait_no_longer(self) -> None:
        """A scan is acted on in real time: from PATIENCE after the first one on, do without `base_info`."""
        if self.has_come or self._given_up:
            return
        self._waits_since = self._waits_since or monotonic()
        if monotonic() - self._waits_since > PATIENCE:
            self._given_up = True
            log.warning("no %s: an erratic's footprint and limits hold where 'base' does not set them", self._key)
