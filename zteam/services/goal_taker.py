"""What takes the goals of one robot: its navigation, or the behaviour go_to that it runs. Pure: it is told all."""

from zteam import names

NAVIGATION, GO_TO = "navigation", "go_to"
GONE = 3.0
"""Host seconds for which what took a goal may be away: a router that ends takes all presence tokens along."""
SETTLE = 0.3
"""Host seconds for navigation's presence token to come before the behaviour go_to gets a goal."""


class GoalTaker:
    """Of robot `robot_id`; times are those of the host, in seconds."""

    def __init__(self, robot_id: int, now: float) -> None:
        self._robot_id = robot_id
        self.kind = ""
        """NAVIGATION, GO_TO, or empty while nothing is known to take goals."""
        self.behavior = ""
        """What the robot's own process runs; empty while it has told nothing."""
        self._since = now
        self._held: set[str] = set()
        """The tokens of the robot's navigation and of its own process."""
        self._gone_since: float | None = None

    @property
    def process(self) -> str:
        """The process that takes the goals, by name."""
        return names.robot_name(self._robot_id) if self.kind == GO_TO else names.navigation_name(self._robot_id)

    @property
    def lack(self) -> str:
        """What is missing, and the way out; empty if something takes goals."""
        if self.kind:
            return ""
        name, navigation = names.robot_name(self._robot_id), names.navigation_name(self._robot_id)
        if self._holds(navigation):
            return f"the first status of {navigation}: it runs, but no tick of a simulator and no data of a base comes"
        runs = f"; it runs the behaviour {self.behavior}, which takes no goals" if self.behavior else ""
        return f"the navigation of {name}: start 'zteam-nav --id {self._robot_id}'{runs}"

    def take_navigation(self) -> None:
        """Navigation spoke."""
        self.kind, self._gone_since = NAVIGATION, None

    def take_behavior(self, behavior: str, now: float) -> None:
        """The robot's own process said what it runs. Navigation wins over go_to, whichever speaks first."""
        self.behavior = behavior
        settled = now - self._since >= SETTLE and not self._holds(names.navigation_name(self._robot_id))
        if not self.kind and behavior == GO_TO and settled:
            self.kind = GO_TO

    def take_token(self, key: str, alive: bool, now: float) -> None:
        """A presence token of one of the two processes came or went."""
        (self._held.add if alive else self._held.discard)(key)
        here = not self.kind or self._holds(self.process)
        self._gone_since = None if here else self._gone_since or now

    def _holds(self, name: str) -> bool:
        return any(key.startswith(f"{name}/") for key in self._held)

    def take_loss(self, now: float) -> str:
        """The process that took the goals, if it is gone for good: then nothing takes them. Else an empty text."""
        if self._gone_since is None or now - self._gone_since < GONE:
            return ""
        gone, self.kind, self._gone_since = self.process, "", None
        return gone
