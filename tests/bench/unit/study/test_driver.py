"""Commands that are drawn in the place of a person's."""

from itertools import islice

from studies.study.driver import SPEED, draw_commands


def test_a_seed_gives_its_commands() -> None:
    """The same ones again, other ones for another seed; in five minutes all kinds of moves."""
    drawn = list(islice(draw_commands(3, 0.1), 3000))
    assert drawn == list(islice(draw_commands(3, 0.1), 3000))
    assert drawn != list(islice(draw_commands(4, 0.1), 3000))
    assert {(0.0, 0.0), (SPEED, 0.0), (-SPEED, 0.0), (0.0, 1.0), (0.0, -1.0), (SPEED, 0.5)} <= set(drawn)


def test_a_turn_round_is_half_a_turn() -> None:
    """Wherever it turns for pi seconds it drives on straight: back through its line."""
    drawn = list(islice(draw_commands(1, 0.1), 6000))
    turns = [
        i for i in range(1, len(drawn) - 32) if drawn[i - 1] != (0.0, 1.0) and drawn[i : i + 31] == [(0.0, 1.0)] * 31
    ]
    assert any(drawn[i + 31] == (SPEED, 0.0) for i in turns)
