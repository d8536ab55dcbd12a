"""idle: a robot that something else drives."""

from support.flat_floor import make_scan, make_view
from zteam.behaviors import decide, load_behavior
from zteam.messages import Twist


def test_it_wants_nothing() -> None:
    """Zero velocity, with a scan and without, and no reason of its own."""
    behavior = load_behavior("idle", {})
    assert behavior.step(make_view(None)) == Twist()
    assert decide(behavior, make_view(make_scan([30.0] * 271))) == (Twist(), "")
