"""What arrives on `robot_N/cmd_vel` between two ticks, from whom, and how long after the scan."""

import threading
from collections.abc import Callable

from zteam import names
from zteam.bus.transport import RawSample
from zteam.clock import monotonic, wait_until
from zteam.messages import Twist
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.runtime.node import Node
from zteam.runtime.writers import Writers


class Commands:
    """The newest command of every robot since the last tick. Filled by the bus's threads."""

    def __init__(self, node: Node, has_robot: Callable[[int], bool], tally: RunStatistics) -> None:
        self._node = node
        self._has_robot = has_robot
        self._tally = tally
        self._lock = threading.Condition()
        self._fresh: dict[int, Twist] = {}
        self._scan_sent: dict[int, float] = {}
        self._holders: dict[int, set[str]] = {}
        self._others = Writers()
        """Sessions that command a robot without holding its name."""
        node.bus.watch_tokens([names.tokens_key()], self._on_token)
        node.bus.subscribe_raw(names.all_robots_key(names.CMD_VEL), self._on_sample)

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        robot_id = names.robot_id_of(token[0]) if token else None
        if token and robot_id is not None:
            with self._lock:
                holders = self._holders.setdefault(robot_id, set())
                (holders.add if alive else holders.discard)(token[1])

    def _on_sample(self, sample: RawSample) -> None:
        target = names.split_robot_key(sample.key)
        if target is None or not self._has_robot(target[0]):
            self._node.bus.counters.drop(sample.key, "the world has no such robot")
            return
        command = self._node.bus.decode(sample, Twist)
        if command is None:
            return
        robot_id = target[0]
        with self._lock:
            if sample.source not in self._holders.get(robot_id, ()):
                self._tally.external_commands += self._tally.go_stamp is not None
                self._others.take(robot_id, sample.source, monotonic())
            self._fresh[robot_id] = command
            self._lock.notify_all()
        self.answered(robot_id)

    def writers(self) -> dict[int, list[str]]:
        """Robots that more than one process commands, and the session ids of these."""
        with self._lock:
            found = {i: others | self._holders.get(i, set()) for i, others in self._others.recent(monotonic()).items()}
        return {robot_id: sorted(sessions) for robot_id, sessions in found.items() if len(sessions) > 1}

    def start_anew(self, tally: RunStatistics) -> None:
        """The world is as at its start: what was commanded before counts no more."""
        with self._lock:
            self._tally = tally
            self._fresh.clear()
            self._scan_sent.clear()

    def scan_sent(self, robot_id: int) -> None:
        """The robot's scan of this tick leaves now."""
        with self._lock:
            self._scan_sent[robot_id] = monotonic()

    def answered(self, robot_id: int) -> None:
        """The robot's command for its scan has come, by whatever way."""
        with self._lock:
            sent = self._scan_sent.pop(robot_id, None)
        if sent is not None:
            self._tally.add_latency(monotonic() - sent)

    def wait_for_answers(self, timeout: float) -> None:
        """Let the robots that were sent a scan answer, for `timeout` host seconds at most."""
        with self._lock:
            # One that was taken out of the world does not answer its last scan.
            self._scan_sent = {i: sent for i, sent in self._scan_sent.items() if self._has_robot(i)}
            wait_until(self._lock, lambda: not any(self._holders.get(i) for i in self._scan_sent), timeout)

    def take(self) -> tuple[dict[int, Twist], list[int]]:
        """The commands since the last call, and the robots with a living process that sent none."""
        with self._lock:
            fresh, self._fresh = self._fresh, {}
            late = [
                robot_id
                for robot_id, holders in self._holders.items()
                if holders and robot_id not in fresh and self._has_robot(robot_id)
            ]
        return {robot_id: command for robot_id, command in fresh.items() if self._has_robot(robot_id)}, late
