"""What else than its view a behaviour asks, and which of it counts."""

import datetime  # noqa: TID251
import logging
import random
import sys
import time  # noqa: TID251

from zteam.behaviors import Behavior
from zteam.trials.chance import Heard


class Asks(Behavior):
    """Its module is this one."""


def test_clocks_and_chance_are_heard_with_the_line() -> None:
    """The host's clocks by name, and random numbers through whatever function of `random`."""
    heard = Heard(Asks)
    with heard.listening():
        time.time()
        datetime.datetime.now()
        random.gauss(0.0, 1.0)
    assert [*heard.clocks] == ["time.time", "datetime.now"]
    assert heard.clocks["datetime.now"].endswith(": datetime.datetime.now()")
    assert heard.chance["random"].endswith(": random.gauss(0.0, 1.0)")


def test_what_a_library_asks_does_not_count() -> None:
    """A log line looks at the clock, and time.perf_counter only measures; afterwards nothing is watched."""
    heard = Heard(Asks)
    with heard.listening():
        logging.getLogger("mine").warning("a line")
        time.perf_counter()
    time.time()
    assert not heard.clocks
    assert not heard.chance
    assert sys.getprofile() is None
