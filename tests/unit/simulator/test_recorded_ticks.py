"""What the ticks of a recording say of each tick, and that a file keeps it."""

from pathlib import Path

from zteam.messages import Input, Tick, encode
from zteam.simulator.recorded_ticks import read_ticks, write_ticks


def test_a_tick_is_what_it_was_sent_as_last(tmp_path: Path) -> None:
    """The held first one after GO alone. A participant that is not in it any more has ended in it."""
    goal = Input(
        1,
        "robot_0/goal_pose",
        "x",
    )
    sent = [
        Tick(tick=1, participants=["tf"]),
        Tick(epoch=1, tick=1, participants=["robot_0"]),
        Tick(epoch=1, tick=1, participants=["robot_0", "tf"], inputs=[goal]),
        Tick(epoch=1, tick=2, participants=["robot_0", "tf"]),
        Tick(epoch=1, tick=2, participants=["tf"]),
        Tick(epoch=1, tick=3, participants=["tf"]),
    ]
    write_ticks(tmp_path / "ticks", map(encode, sent))
    found = read_ticks(tmp_path / "ticks")
    assert {number: (set(each.members), set(each.leaving)) for number, each in found.items()} == {
        1: ({"robot_0", "tf"}, set()),
        2: ({"robot_0", "tf"}, {"robot_0"}),
        3: ({"tf"}, set()),
    }
    assert [each.inputs for each in found.values()] == [[goal], [], []]
