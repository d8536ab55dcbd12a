"""The static transforms of a team: the authority of each frame, and start poses that a localiser shadows."""

import math
from itertools import permutations

import pytest

from support.transforms import S, stamped
from zteam.clock import Sent
from zteam.messages import TransformStamped
from zteam.transforms.buffer import Buffer
from zteam.transforms.static_transforms import MOST_SOURCES, Rank, Static, StaticTransforms

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
    assert statics.holders[ODOM].authority == min(first, second).name


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


def test_an_edge_that_is_said_anew_under_another_parent_goes_first() -> None:
    """Only edges of that source go: those with another parent, or turned round. Edges that it does not repeat stay."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    for child in ("kept", "silent", "moved", "turned"):
        statics.put(Static(Rank.SIMULATOR, stamped("base", child, 0), "robot_0"))
    statics.put(Static(Rank.SIMULATOR, stamped("other", "moved_too", 0), "robot_1"))
    new = {
        "kept": stamped("base", "kept", 0, 9.0),
        "moved": stamped("kept", "moved", 0),
        "moved_too": stamped("kept", "moved_too", 0),
        "base": stamped("turned", "base", 0),
    }
    statics.drop_reparented("robot_0", new)
    assert [child for child, _ in _shown(statics)] == ["kept", "moved_too", "silent"]
    assert sorted(buffer.frames()) == ["kept", "moved_too", "silent"]


def test_a_source_that_lives_counts_before_one_that_may_have_ended() -> None:
    """The first one that lives holds a frame; when it ends the next one has it, and the first one's return brings it
    back.
    """
    living = {"sim", "driver"}
    statics = StaticTransforms(Buffer(), lambda authority: authority if authority in living else None)
    for x, source in enumerate(("script", "sim", "driver", "other")):
        statics.put(Static(Rank.SIMULATOR, _camera(float(x)), source))
    assert _shown(statics) == [("robot_0/camera", 1.0)]
    for gone, x in (("sim", 2.0), ("driver", 3.0)):
        living.discard(gone)
        statics.look_again(gone)
        assert _shown(statics) == [("robot_0/camera", x)]
    living.add("driver")
    statics.look_again("driver")
    assert _shown(statics) == [("robot_0/camera", 2.0)]


def test_a_source_that_cannot_be_asked_gives_way_to_the_next_one() -> None:
    """A script that is started again may say the frame anew; what the first run repeats does not bring it back."""
    statics = StaticTransforms(Buffer(), lambda authority: None)
    for source, x in (("first", 0.1), ("second", 0.2), ("first", 0.3)):
        statics.put(Static(Rank.SIMULATOR, _camera(x), source))
    assert _shown(statics) == [("robot_0/camera", 0.2)]


def test_what_a_source_said_last_counts() -> None:
    """A message that was sent earlier and comes later changes nothing: a session may have two publishers."""
    statics = StaticTransforms(Buffer())
    for x, sent in ((0.2, 20), (0.1, 10)):
        statics.put(Static(Rank.SIMULATOR, _camera(x), "sim", Sent(sent)))
    assert _shown(statics) == [("robot_0/camera", 0.2)]


@pytest.mark.parametrize("first", [Sent(10**6, 0.0), Sent(10**9, -3600.0, 1.9)], ids=["set back", "ahead"])
def test_what_a_source_says_later_counts_whatever_its_stamp(first: Sent) -> None:
    """The clock of its host was ahead, or it was set back since; an edge with another parent counts as well."""
    statics = StaticTransforms(Buffer())
    statics.put(Static(Rank.SIMULATOR, _camera(0.2), "sim", first))
    later = Static(Rank.SIMULATOR, _camera(0.1, "mast"), "sim", Sent(10, 0.0, 2.0))
    statics.drop_reparented("sim", {"robot_0/camera": later.transform}, later.sent)
    statics.put(later)
    assert statics.message().transforms == [later.transform]


def test_invented_sources_do_not_fill_the_memory() -> None:
    """A thousand sources of a frame are forgotten again; the one that lives stays."""
    statics = StaticTransforms(Buffer(), lambda authority: authority if authority == "sim" else None)
    statics.put(Static(Rank.SIMULATOR, _camera(1.0), "sim"))
    for number in range(1000):
        statics.put(Static(Rank.SIMULATOR, _camera(2.0), str(number)))
    assert len(statics._said["robot_0/camera"]) == MOST_SOURCES
    assert _shown(statics) == [("robot_0/camera", 1.0)]


def test_a_source_that_lives_is_not_forgotten_for_those_that_ended() -> None:
    """It does not hold the frame, and says it again when the holder has ended, however often others came and went."""
    alive = {"sim", "driver"}
    statics = StaticTransforms(Buffer(), lambda authority: authority if authority in alive else None)
    statics.put(Static(Rank.SIMULATOR, _camera(1.0), "sim"))
    statics.put(Static(Rank.SIMULATOR, _camera(2.0), "driver"))
    for number in range(3 * MOST_SOURCES):
        statics.put(Static(Rank.SIMULATOR, _camera(3.0), str(number)))
    alive.discard("sim")
    statics.look_again("sim")
    assert _shown(statics) == [("robot_0/camera", 2.0)]


def test_a_frame_that_moves_is_not_made_fixed() -> None:
    """A static transform for a moving frame is refused, and both sources are named: else its samples would be."""
    buffer = Buffer()
    statics = StaticTransforms(buffer)
    buffer.set_transform(stamped(ODOM, "robot_0/base", S, 1.0), "robot_0")
    refused = statics.put(Static(Rank.SIMULATOR, stamped(ODOM, "robot_0/base", 0), "script"))
    assert refused is not None
    assert refused.text == "robot_0/base moves, by robot_0: the static transform of script is refused"
    assert buffer.set_transform(stamped(ODOM, "robot_0/base", 2 * S, 2.0), "robot_0") is None


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
