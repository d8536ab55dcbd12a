"""The record of conflicts between sources of transforms."""

from zteam.tf.conflicts import MAX_CONFLICTS, Conflicts


def test_a_repeated_conflict_is_recorded_once() -> None:
    """Another frame, authority or code is another conflict; the same three again keep the first text."""
    conflicts = Conflicts()
    for key in (("a", "robot_0", "TF_LOOP"), ("b", "robot_0", "TF_LOOP"), ("a", "robot_1", "TF_LOOP")):
        conflicts.report(*key, f"first {key}")
        conflicts.report(*key, "again")
    conflicts.report("a", "robot_0", "TF_OLD_DATA", "other code")
    assert len(conflicts.all()) == 4
    assert "again" not in conflicts.all()


def test_each_conflict_is_read_once() -> None:
    """`take_unread` returns only the conflicts since its last call; `all` keeps them."""
    conflicts = Conflicts()
    conflicts.report("a", "robot_0", "TF_LOOP", "one")
    assert conflicts.take_unread() == ["one"]
    conflicts.report("a", "robot_0", "TF_LOOP", "one")
    conflicts.report("b", "robot_0", "TF_LOOP", "two")
    assert conflicts.take_unread() == ["two"]
    assert conflicts.take_unread() == []
    assert conflicts.all() == ["one", "two"]


def test_the_number_of_conflicts_is_bounded() -> None:
    """A robot that invents frames without end does not fill the memory."""
    conflicts = Conflicts()
    for number in range(MAX_CONFLICTS + 5):
        conflicts.report(f"frame_{number}", "robot_0", "foreign", str(number))
    assert len(conflicts.all()) == len(conflicts.take_unread()) == MAX_CONFLICTS
    assert conflicts.all()[-1] == str(MAX_CONFLICTS - 1)
