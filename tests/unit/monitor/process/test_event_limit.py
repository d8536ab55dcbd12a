"""Events that strangers make: neither the log nor the team's memory grows with them."""

from support.gate_feed import come
from zteam.monitor.process.members import Event, EventLimit
from zteam.monitor.process.start_gate import Gate


def shown(limit: EventLimit, events: list[Event], now: float, *, counts: bool) -> list[str]:
    """The lines of the events that are shown."""
    return [event.sentence for e in events if (event := limit.admit(e, counts, now)) is not None]


def test_a_forged_status_fills_no_log() -> None:
    """Of thousands of faults of one robot 8 are shown, the last of them says so; other robots and kinds are not
    concerned, and 10 s later it begins anew."""
    limit = EventLimit()
    faults = [Event("fault", 1, f"fault: {i}") for i in range(3000)]
    lines = shown(limit, faults, 0.0, counts=True)
    assert len(lines) == 8
    assert lines[-1] == "robot_1 fault: 7 (further lines of this kind are left out for 10 s)"
    others = [Event("fault", 2, "fault: a"), Event("lost", 1, "lost"), Event("link", None, "router lost")]
    assert shown(limit, others, 1.0, counts=True) == ["robot_2 fault: a", "robot_1 lost", "router lost"]
    assert len(shown(limit, faults, 10.0, counts=True)) == 8


def test_invented_robots_share_their_lines() -> None:
    """Two thousand names that come and go make 16 lines."""
    lost = [Event("lost", i, "lost") for i in range(100, 2100)]
    assert len(shown(EventLimit(), lost, 0.0, counts=False)) == 16


def test_invented_robots_are_forgotten() -> None:
    """Of two thousand that came and went the last status names 64; one that the team waits for is never left out."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1)
    for i in range(100, 2100):
        gate.take_token(i, True)
        gate.take_token(i, False)
    gate.take_token(1, False)
    assert len(gate.members) == 2 + 64
    assert gate.lost == [1, *range(100, 164)]
