"""When a tick is sent again, and when its silent participants are named or dropped."""

from zteam.simulator.process.lockstep import MAX_RESEND, NAME_AFTER, RESEND, Patience


def test_the_time_between_repeats_doubles_up_to_a_limit() -> None:
    """The first repeat comes after RESEND, later ones after MAX_RESEND at most."""
    patience = Patience(10.0, 0.0)
    delays = []
    for _ in range(6):
        delays.append(patience.delay)
        patience.lengthen()
    assert delays == [RESEND, 2 * RESEND, 4 * RESEND, 8 * RESEND, MAX_RESEND, MAX_RESEND]


def test_silence_is_named_and_named_again_after_five_seconds_until_it_is_over() -> None:
    """Not before NAME_AFTER, and not with every repeat; of a pause of the machine between two looks a part counts."""
    patience = Patience(8.2, 0.0)
    seen = []
    for now in (NAME_AFTER, 1.1, 1.6, 3.0, 4.5, 6.0, 6.2, 7.0, 60.0):
        patience.look(now)
        seen.append((patience.names_silent(), patience.is_over))
    assert [named for named, _ in seen] == [False, True, False, False, False, False, True, False, False]
    assert [over for _, over in seen] == [False] * 8 + [True]


def test_after_a_drop_the_next_silence_is_named_in_its_time() -> None:
    """The remaining participants get the whole time again, warning included."""
    patience = Patience(2.0, 0.0)
    for now in (1.1, 2.1):
        patience.look(now)
        patience.names_silent()
    assert patience.is_over
    patience.start_anew()
    patience.look(2.6)
    assert (patience.is_over, patience.names_silent()) == (False, False)
    patience.look(2.1 + NAME_AFTER + 0.1)
    assert patience.names_silent()
