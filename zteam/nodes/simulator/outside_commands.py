"""Velocities and goals of processes that take no part in lock-step, which make a run unrepeatable: they are counted."""

import threading
from collections.abc import Callable

from zteam import names
from zteam.bus.transport import RawSample
from zteam.nodes.simulator.lockstep import LockStep
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.tokens import TokenSet

TOPICS = (names.CMD_VEL_TELEOP, names.CMD_VEL_NAV, names.GOAL_POSE, names.INITIAL_POSE)
"""What tells a robot from outside where to drive, besides `cmd_vel` itself (`Commands`)."""


class OutsideCommands:
    """Counts them in the report. Nothing is decoded, so what participants send on these keys costs little."""

    def __init__(
        self, node: ProcessNode, has_robot: Callable[[int], bool], lockstep: LockStep, statistics: RunStatistics
    ) -> None:
        self._has_robot = has_robot
        self._lockstep = lockstep
        self._statistics = statistics
        self._lock = threading.Lock()
        self._holders = TokenSet()
        node.bus.watch_tokens([names.tokens_key()], self._on_token)
        for topic in TOPICS:
            node.bus.subscribe_raw(names.all_robots_key(topic), self._on_sample)

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None:
            with self._lock:
                self._holders.take(*token, alive)

    def _on_sample(self, sample: RawSample) -> None:
        target = names.split_robot_key(sample.key)
        if target is None or not self._has_robot(target[0]):
            return
        with self._lock:
            sender = self._holders.name_of(sample.source)
        if sender not in self._lockstep.participants:
            self._statistics.add_external_command()
