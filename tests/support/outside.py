"""Messages to a team in lock-step from a process that takes no part."""

from zteam import names
from zteam.bus.receiving import KeyCount
from zteam.messages import Message
from zteam.team.testing.team import TeamFixture


def send(team: TeamFixture, key: str, message: Message) -> None:
    """Publish a message from outside; the simulator has it when this returns."""

    def received() -> int:
        counts = team.bus.ask(names.stats_key(names.SIMULATOR), dict[str, KeyCount])
        return counts.get(key, KeyCount()).received

    before = received()
    team.bus.publisher(key, type(message)).put(message)
    team.wait_for(lambda: received() > before)
