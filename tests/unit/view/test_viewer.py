"""One page's state: credit, what it has, what it sees."""

from zteam.view.received import Viewer
from zteam.view.requests import MAX_WATCHES, Ack, Look, Watch


def test_a_page_has_credit_for_two_frames() -> None:
    """Two that are not acknowledged hold the next one back; what it was never sent does not count."""
    viewer = Viewer(1, may_command=False)
    first, second = viewer.next_frame(10.0), 0
    assert viewer.has_credit
    second = viewer.next_frame(10.1)
    assert not viewer.has_credit
    viewer.take_ack(Ack(second + 1))
    assert not viewer.has_credit
    viewer.take_ack(Ack(first))
    assert viewer.has_credit
    viewer.take_ack(Ack(second))
    viewer.next_frame(10.2)
    assert viewer.has_credit


def test_a_page_is_sent_each_version_once() -> None:
    """It lacks a thing until it has that version."""
    viewer = Viewer(1, may_command=False)
    assert [viewer.lacks("map", version) for version in (1, 1, 2, 2, 1)] == [True, False, True, False, True]


def test_a_page_sees_what_is_in_its_viewport() -> None:
    """Without a viewport it sees everything."""
    viewer = Viewer(1, may_command=False)
    assert viewer.sees(1e5, 0.0)
    viewer.look = Look(viewport=[0.0, 0.0, 2.0, 1.0])
    assert (viewer.sees(2.0, 1.0), viewer.sees(2.1, 0.5)) == (True, False)


def test_a_page_watches_a_bounded_number_of_topics() -> None:
    """One more is not watched."""
    viewer = Viewer(1, may_command=False)
    for number in range(MAX_WATCHES + 1):
        viewer.take_watch(Watch(f"topic_{number}"))
    assert len(viewer.watches) == MAX_WATCHES
