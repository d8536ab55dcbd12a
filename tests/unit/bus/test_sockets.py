"""The links of sessions, counted."""

from itertools import permutations
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from zteam.bus.sockets import LinkCount

BEGIN, END = zenoh.SampleKind.PUT, zenoh.SampleKind.DELETE


def link(kind: zenoh.SampleKind, session: str = "a") -> Any:
    """An event of Zenoh."""
    return SimpleNamespace(kind=kind, transport=SimpleNamespace(zid=session))


@pytest.mark.parametrize(
    ("events", "sessions"),
    [
        ([link(BEGIN), link(END), link(BEGIN)], {"a"}),
        ([link(BEGIN), link(END), link(BEGIN), link(END)], set()),
        ([link(BEGIN), link(BEGIN, "b"), link(END)], {"b"}),
    ],
)
def test_the_order_of_ends_and_beginnings_does_not_matter(events: list[Any], sessions: set[str]) -> None:
    """A session has a link if more of its links have begun than ended, in whichever order that was told."""
    for order in permutations(events):
        links = LinkCount()
        for event in order:
            links.count(event)
        assert links.sessions == sessions


def test_a_link_in_the_place_of_another_is_noticed() -> None:
    """It is one that begins before the end of the last one was told."""
    links = LinkCount()
    assert [links.count(link(kind)) for kind in (BEGIN, BEGIN, END, END, BEGIN)] == [False, True, False, False, False]
