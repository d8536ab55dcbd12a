"""When a tick is sent again, and when its silent participants are named or dropped."""

from zteam.nodes.simulator.lockstep import MAX_RESEND, NAME_AFTER, RESEND, ResendSchedule, Silence


def test_the_time_between_repeats_doubles_up_to_a_limit() -> None:
    """The first repeat comes after RESEND, later ones after MAX_RESEND at most."""
    schedule = ResendSchedule(10.0)
    delays = []
    for _ in range(6):
        delays.append(schedule.delay)
        schedule.lengthen()
    assert delays == [RESEND, 2 * RESEND, 4 * RESEND, 8 * RESEND, MAX_RESEND, MAX_RESEND]


def test_silence_is_named_and_named_again_after_five_seconds() -> None:
    """Not before NAME_AFTER, and not with every repeat."""
    schedule = ResendSchedule(100.0)
    verdicts = {waited: schedule.judge(waited, held=False) for waited in (NAME_AFTER, 1.1, 1.6, 6.0, 6.2, 7.0)}
    assert [waited for waited, verdict in verdicts.items() if verdict is Silence.NAME] == [1.1, 6.2]
    assert set(verdicts.values()) == {Silence.WAIT, Silence.NAME}


def test_the_time_out_drops() -> None:
    """A tick that has been open for longer than the time-out goes on without its silent participants."""
    schedule = ResendSchedule(2.0)
    assert schedule.judge(2.0, held=False) is Silence.NAME
    assert schedule.judge(2.1, held=False) is Silence.DROP


def test_after_a_drop_the_next_silence_is_named_in_its_time() -> None:
    """The remaining participants get the whole time again, warning included."""
    schedule = ResendSchedule(2.0)
    schedule.judge(1.9, held=False)
    schedule.judge(2.1, held=False)
    assert schedule.judge(0.5, held=False) is Silence.WAIT
    assert schedule.judge(NAME_AFTER + 0.1, held=False) is Silence.NAME


def test_a_held_tick_has_no_time_out() -> None:
    """A start may take any time; it is named like any other wait."""
    schedule = ResendSchedule(2.0)
    assert schedule.judge(3600.0, held=True) is Silence.NAME
    assert schedule.judge(3601.0, held=True) is Silence.WAIT
