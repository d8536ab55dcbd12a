"""The static transforms of a team: the authority of each frame, and start poses that a localiser shadows."""

import math
from itertools import permutations

import pytest

from support.transforms import S, stamped
from zteam.messages import TransformStamped
from zteam.tf.buffer import Buffer
from zteam.tf.static_transforms import Rank, Static, StaticTransforms

ODOM = "robot_0/odom"
SOURCES = (Rank.TEAM_FILE, Rank.SIMULATOR, Rank.CALLER, Rank.DESCRIPTION)


def _start_pose(x: float, stamp: int = 0) -> TransformStamped:
    return stamped("map", ODOM, stamp, x)


def _camera(x: float, parent: str = "base_link") -> TransformStamped:
    return stamped(f"robot_0/{parent}", "robot_0/camera", 0, x)


def _shown(statics: StaticTransforms) -> list[tuple[str, float]]:
    return [(t.child_frame_id, t.transform.translation.x) for t in statics.message().transforms]


def _x(buffer: Buffer, child: str = ODOM, parent: str = "map") -> float:
    return buffer.lookup_pose2(parent, child, 0)[0].x


@pytest.mark.parametrize(("first", "second"), list(permutations(SOURCES, 2)))
def test_the_source_of_the_highest_rank_gives_the_start_pose(first: Rank, second: Rank) -> None:
    """Whichever comes first, the higher rank holds, without a conflict between two different ranks."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    for rank in (first, second):
        assert statics.put(Static(rank, _start_pose(float(rank)), rank.name)) is None
    assert _shown(statics) == [(ODOM, float(min(first, second)))]
    assert _x(buffer) == float(min(first, second))
    known = statics.get(ODOM)
    assert known is not None
    assert known.authority == min(first, second).name


@pytest.mark.parametrize(("first", "second"), [(Rank.TEAM_FILE, Rank.SIMULATOR), (Rank.CALLER, Rank.SIMULATOR)])
def test_any_other_frame_stays_with_its_first_authority(first: Rank, second: Rank) -> None:
    """A second authority is refused whatever its rank, and the text names both."""
    statics = StaticTransforms(Buffer())
    assert statics.put(Static(first, _camera(0.1), "one")) is None
    refused = statics.put(Static(second, _camera(0.2), "two"))
    assert refused == ("second authority", "robot_0/camera is said by one and by two: one stays")
    assert _shown(statics) == [("robot_0/camera", 0.1)]


def test_two_callers_cannot_both_give_a_start_pose() -> None:
    """Two authorities of one rank are a conflict for a start pose too."""
    statics = StaticTransforms(Buffer())
    assert statics.put(Static(Rank.CALLER, _start_pose(1.0), "one")) is None
    refused = statics.put(Static(Rank.CALLER, _start_pose(2.0), "two"))
    assert refused is not None
    assert refused.code == "second authority"
    assert _shown(statics) == [(ODOM, 1.0)]


def test_a_description_gives_way_for_every_frame() -> None:
    """A robot's own static transform replaces the description's, also under another parent, and not the reverse."""
    statics = StaticTransforms(Buffer())
    assert statics.put(Static(Rank.DESCRIPTION, _camera(0.1), "description")) is None
    assert statics.put(Static(Rank.SIMULATOR, _camera(0.2, "mast"), "robot_0")) is None
    assert statics.put(Static(Rank.DESCRIPTION, _camera(0.1), "description")) is None
    (shown,) = statics.message().transforms
    assert shown == _camera(0.2, "mast")


def test_only_a_new_value_counts_as_a_change() -> None:
    """`changed` is set by a new value and cleared by `message`; the same value again or a refusal does not set it."""
    statics = StaticTransforms(Buffer())
    statics.put(Static(Rank.SIMULATOR, _camera(0.1), "robot_0"))
    assert statics.changed
    statics.message()
    statics.put(Static(Rank.SIMULATOR, _camera(0.1), "robot_0"))
    assert statics.put(Static(Rank.SIMULATOR, _camera(math.nan), "robot_0")) is not None
    assert not statics.changed
    statics.put(Static(Rank.SIMULATOR, _camera(0.3), "robot_0"))
    assert statics.changed
    assert _shown(statics) == [("robot_0/camera", 0.3)]


def test_a_localiser_shadows_the_start_pose_until_it_is_forgotten() -> None:
    """The shadowed pose is in neither the message nor the buffer, follows its source, and comes back."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    statics.put(Static(Rank.SIMULATOR, _start_pose(1.0), "robot_0"))
    statics.message()
    assert statics.localise(_start_pose(5.0, S), "robot_0") is None
    assert statics.changed
    assert _shown(statics) == []
    assert statics.put(Static(Rank.SIMULATOR, _start_pose(2.0), "robot_0")) is None
    assert _x(buffer) == 5.0
    assert not statics.changed
    statics.restore_start_poses()
    assert statics.changed
    assert _shown(statics) == [(ODOM, 2.0)]
    assert _x(buffer) == 2.0


def test_a_refused_localiser_shadows_nothing() -> None:
    """After a sample that is not a number, the start pose is in the buffer and in the message as before."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    statics.put(Static(Rank.SIMULATOR, _start_pose(1.0), "robot_0"))
    statics.message()
    refused = statics.localise(_start_pose(math.nan, S), "robot_0")
    assert refused is not None
    assert refused.code == "TF_NAN_INPUT"
    assert _x(buffer) == 1.0
    assert not statics.changed
    assert _shown(statics) == [(ODOM, 1.0)]


def test_only_the_team_file_fixes_a_start_pose() -> None:
    """Every other source gives way to a localiser; an unknown frame is not fixed either."""
    for rank in SOURCES:
        statics = StaticTransforms(Buffer())
        assert not statics.is_fixed_by_team_file(ODOM)
        statics.put(Static(rank, _start_pose(1.0), "source"))
        assert statics.is_fixed_by_team_file(ODOM) is (rank == Rank.TEAM_FILE)


def test_a_new_full_set_drops_missing_frames_and_changed_parents() -> None:
    """Only edges of that authority and rank go: those that the new set lacks or has under another parent."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    for child in ("kept", "gone", "moved"):
        statics.put(Static(Rank.SIMULATOR, stamped("base", child, 0), "robot_0"))
    statics.put(Static(Rank.DESCRIPTION, stamped("base", "described", 0), "robot_0"))
    statics.put(Static(Rank.SIMULATOR, stamped("base", "other", 0), "robot_1"))
    new = {"kept": stamped("base", "kept", 0, 9.0), "moved": stamped("kept", "moved", 0)}
    statics.drop_replaced("robot_0", Rank.SIMULATOR, new)
    assert [child for child, _ in _shown(statics)] == ["described", "kept", "other"]
    assert sorted(buffer.frames()) == ["described", "kept", "other"]


def test_an_authority_leaves_with_all_its_frames() -> None:
    """Its static transforms leave the message and the buffer; a localiser's data stays."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    statics.put(Static(Rank.CALLER, stamped("map", "table", 0), "tool"))
    statics.put(Static(Rank.CALLER, _start_pose(1.0), "tool"))
    statics.put(Static(Rank.CALLER, stamped("map", "door", 0), "other"))
    statics.localise(_start_pose(5.0, S), "robot_0")
    statics.message()
    statics.drop_authority("tool")
    assert statics.changed
    assert [child for child, _ in _shown(statics)] == ["door"]
    assert _x(buffer) == 5.0
    assert sorted(buffer.frames()) == ["door", ODOM]
