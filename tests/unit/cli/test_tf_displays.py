"""The listener of `zteam tf`, on a bus in memory."""

import tracemalloc

from support.transforms import S, stamped
from zteam import names
from zteam.bus import MemoryHub
from zteam.cli.tf_displays import TreeListener
from zteam.messages import TFMessage, time_from_ns


def test_the_memory_of_a_listener_is_bounded(hub: MemoryHub) -> None:
    """Once the buffer's ten seconds are full, a listener that runs for days needs no more memory."""
    listener, publisher = TreeListener(hub.bus()), hub.bus().publisher(names.TF, TFMessage)
    transform = stamped("map", "robot_0/base_footprint", 0)

    def publish(ticks: range) -> int:
        for tick in ticks:
            transform.header.stamp = time_from_ns(tick * S)
            publisher.put(TFMessage([transform]))
        return tracemalloc.get_traced_memory()[0]

    publish(range(1, 10))
    tracemalloc.start()
    try:
        first = publish(range(10, 500))
        assert publish(range(500, 3000)) - first < 20_000
    finally:
        tracemalloc.stop()
    assert listener.buffer.frames()["robot_0/base_footprint"].newest == 2999 * S
