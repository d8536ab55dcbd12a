"""When a tick is sent again, and when its silent participants are named or dropped."""

from zteam.simulator.process.lockstep import MAX_RESEND, NAME_AFTER, RESEND, Patience


def waiting(timeout: float) -> Patience:
    """The patience of a tick that was sent at host time 0."""
    return Patience(timeout, 0.0)


def test_the_time_between_repeats_doubles_up_to_a_limit() -> None:
    """The first repeat comes after RESEND, later ones after MAX_RESEND at most."""
    patience = waiting(10.0)
    delays = []
    for _ in range(6):
        delays.append(patience.delay)
        patience.lengthen()
    assert delays == [RESEND, 2 * RESEND, 4 * RESEND, 8 * RESEND, MAX_RESEND, MAX_RESEND]


def test_silence_is_named_and_named_again_after_five_seconds() -> None:
    """Not before NAME_AFTER, and not with every repeat."""
    patience = waiting(100.0)
    named = []
    for now in (NAME_AFTER, 1.1, 1.6, 3.0, 4.5, 6.0, 6.2, 7.0):
        patience.look(now)
        named += [now] if patience.names_silent() else []
    assert named == [1.1, 6.2]


def test_a_pause_of_the_machine_is_no_silence() -> None:
    """Of a long time between two looks a part counts."""
    patience = waiting(10.0)
    patience.look(60.0)
    assert patience.waited < 2.0


def test_the_time_out_drops() -> None:
    """A tick that has been open for longer than the time-out goes on without its silent participants."""
    patience = waiting(2.0)
    for now, over in ((1.0, False), (2.0, False), (2.1, True)):
        patience.look(now)
        assert patience.is_over is over


def test_after_a_drop_the_next_silence_is_named_in_its_time() -> None:
    """The remaining participants get the whole time again, warning included."""
    patience = waiting(2.0)
    for now in (1.1, 2.1):
        patience.look(now)
        patience.names_silent()
    patience.start_anew()
    patience.look(2.6)
    assert (patience.is_over, patience.names_silent()) == (False, False)
    patience.look(2.1 + NAME_AFTER + 0.1)
    assert patience.names_silent()
