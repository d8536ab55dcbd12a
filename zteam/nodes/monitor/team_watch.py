"""Feeds a team from the bus: the robots' statuses, the holders of the names, and the link to the router."""

from zteam import names
from zteam.clock import monotonic
from zteam.messages import RobotStatus
from zteam.nodes.monitor.team import Team
from zteam.nodes.monitor.writer_watch import WriterWatch
from zteam.runtime.node import Node
from zteam.runtime.token_loss import TokenLossFilter
from zteam.runtime.tokens import TokenSet

_SERVERS = {
    names.SIMULATOR: ("the simulator", "time stands still"),
    names.AGGREGATOR: ("the aggregator", "there are no new transforms"),
    names.MONITOR: ("the monitor", "GO is not given to robots that come now"),
}
"""Processes that a team needs besides its robots: what they are called, and what it means that one is gone."""


class TeamWatch:
    """Callbacks run under `node.changed`."""

    def __init__(self, node: Node, team: Team) -> None:
        self._node = node
        self._team = team
        self._losses = TokenLossFilter()
        self._servers = TokenSet()
        self.servers_gone: dict[str, str] = {}
        """Those processes that were there and are gone, by name: what that means, in words."""
        self.link_up = True
        self.simulator_came = False
        """Whether a simulator's token has come; set back by the caller that acts on it."""
        self.writers = WriterWatch(node, team)
        node.bus.watch_link(self._on_link)
        node.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._on_status)
        node.watch_tokens(names.tokens_key(), self._on_token)

    def _on_link(self, up: bool) -> None:
        with self._node.changed:
            self.link_up = up
            self._losses.take_link(up, monotonic())
            self._team.members.forgive_silence(monotonic())
            self._team.members.tell("link", None, "router is back" if up else "router lost")
            self._node.changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None:
            return
        name, instance = token
        self.writers.take_token(name, instance, alive)
        if name == names.SIMULATOR and alive:
            self.simulator_came = True
        robot_id = names.robot_id_of(name)
        if robot_id is None and name not in _SERVERS:
            return
        self._losses.take_token(key, alive, monotonic())
        if alive:
            self._take(name, instance, True)

    def _take(self, name: str, instance: str, alive: bool) -> None:
        robot_id = names.robot_id_of(name)
        if robot_id is not None:
            self._team.take_token(robot_id, instance, alive)
        elif self._servers.take(name, instance, alive):
            what, meaning = _SERVERS[name]
            if name == names.SIMULATOR and not alive:
                self._team.take_world(None)
            if not alive:
                self.servers_gone[name] = f"{what} is gone: {meaning}"
                self._team.members.tell("process", None, self.servers_gone[name])
            elif self.servers_gone.pop(name, ""):
                self._team.members.tell("process", None, f"{what} is back")

    def _on_status(self, key: str, status: RobotStatus) -> None:
        target = names.split_robot_key(key)
        if target is None or not self._team.take_status(target[0], status, monotonic()):
            self._node.bus.counters.drop(key, f"it speaks for robot {status.robot_id}")

    def take_losses(self) -> None:
        """Take what has been gone for long enough to be lost (under `node.changed`)."""
        now = monotonic()
        for key in self._losses.take_due(now):
            token = names.split_token_key(key)
            if token:
                self._take(*token, False)
        if self._losses.trusted(now):
            self._team.members.check_silence(now)

    def notes(self) -> list[str]:
        """What is wrong besides the robots, in words (under `node.changed`)."""
        found = [] if self.link_up else ["the router is lost: nothing can be heard"]
        found += self.servers_gone.values()
        if names.AGGREGATOR not in self._servers and names.AGGREGATOR not in self.servers_gone:
            found.append("no aggregator yet (zteam-tf): poses are not known")
        return found
