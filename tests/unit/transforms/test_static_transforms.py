"""The static transforms of a team: the authority of each frame, and start poses that a localiser shadows."""

import math
from itertools import permutations

import pytest

from support.transforms import S, stamped
from zteam.clock import Sent
from zteam.messages import TransformStamped
from zteam.transforms.buffer import Buffer
from zteam.transforms.static_transforms import MOST_SOURCES, Rank, Static, StaticTransforms, is_start_pose

ODOM, CAMERA = "robot_0/odom", "robot_0/camera"
SOURCES = (Rank.TEAM_FILE, Rank.SIMULATOR, Rank.CALLER, Rank.DESCRIPTION)


def start_pose(x: float, stamp: int = 0) -> TransformStamped:
    """Where robot 0 starts, or where a localiser has it."""
    return stamped("map", ODOM, stamp, x)


def camera(x: float, parent: str = "base_link") -> TransformStamped:
    """A frame of which nobody has the only say."""
    return stamped(f"robot_0/{parent}", CAMERA, 0, x)


class Statics(StaticTransforms):
    """Static transforms and their buffer, of sources of which some live."""

    def __init__(self, *living: str) -> None:
        self.tree, self.living = Buffer(), {*living}
        super().__init__(self.tree, lambda source: source if not living or source in self.living else None)

    def say(self, x: float, source: str, rank: Rank = Rank.SIMULATOR) -> str:
        """A source says where the camera is; the code of a refusal."""
        refused = self.put(Static(rank, camera(x), source))
        return refused.code if refused else ""

    def xs(self) -> dict[str, float]:
        """x by child of the full set."""
        return {t.child_frame_id: t.transform.translation.x for t in self.message().transforms}


@pytest.mark.parametrize(
    ("parent", "child", "expected"),
    [
        ("map", "robot_3/odom", True),
        ("map", "robot_3/base_link", False),
        ("robot_3/base_link", "robot_3/odom", False),
        ("map", "odom", False),
    ],
)
def test_a_start_pose_leads_from_the_map_to_a_robots_odom(parent: str, child: str, expected: bool) -> None:
    """Both frames must match."""
    assert is_start_pose(stamped(parent, child, S)) is expected


@pytest.mark.parametrize(("first", "second"), list(permutations(SOURCES, 2)))
def test_the_source_of_the_highest_rank_gives_the_start_pose(first: Rank, second: Rank) -> None:
    """Whichever comes first, the higher rank holds, without a conflict between two different ranks."""
    statics = Statics()
    for rank in (first, second):
        assert statics.put(Static(rank, start_pose(float(rank)), rank.name)) is None
    assert statics.xs() == {ODOM: float(min(first, second))}
    assert statics.tree.lookup_pose2("map", ODOM, 0)[0].x == float(min(first, second))
    assert statics.holders[ODOM].authority == min(first, second).name


def test_a_second_authority_is_refused_and_named() -> None:
    """Of any other frame whatever its rank, of a start pose within one rank: the first one stays."""
    for first, second in ((Rank.TEAM_FILE, Rank.SIMULATOR), (Rank.CALLER, Rank.SIMULATOR)):
        statics = Statics()
        assert statics.put(Static(first, camera(0.1), "one")) is None
        refused = statics.put(Static(second, camera(0.2), "two"))
        assert refused == ("second authority", "robot_0/camera is said by one and by two: one stays")
        assert statics.xs() == {CAMERA: 0.1}
    statics = Statics()
    assert statics.put(Static(Rank.CALLER, start_pose(1.0), "one")) is None
    assert statics.put(Static(Rank.CALLER, start_pose(2.0), "two")) is not None
    assert statics.xs() == {ODOM: 1.0}


def test_a_description_gives_way_for_every_frame() -> None:
    """A robot's own static transform replaces the description's, also under another parent, and not the reverse."""
    statics = Statics()
    assert statics.put(Static(Rank.DESCRIPTION, camera(0.1), "description")) is None
    assert statics.put(Static(Rank.SIMULATOR, camera(0.2, "mast"), "robot_0")) is None
    assert statics.put(Static(Rank.DESCRIPTION, camera(0.1), "description")) is None
    assert statics.message().transforms == [camera(0.2, "mast")]


def test_only_a_new_value_counts_as_a_change() -> None:
    """`changed` is set by a new value and cleared by `message`; the same value again or a refusal does not set it."""
    statics = Statics()
    statics.say(0.1, "robot_0")
    assert statics.changed
    statics.message()
    assert [statics.say(x, "robot_0") for x in (0.1, math.nan)] == ["", "TF_NAN_INPUT"]
    assert not statics.changed
    statics.say(0.3, "robot_0")
    assert statics.changed
    assert statics.xs() == {CAMERA: 0.3}


def test_a_localiser_shadows_the_start_pose_until_it_is_forgotten() -> None:
    """The shadowed pose is in neither the message nor the buffer, follows its source, and comes back."""
    statics = Statics()
    statics.put(Static(Rank.SIMULATOR, start_pose(1.0), "robot_0"))
    statics.message()
    refused = statics.localise(start_pose(math.nan, S), "robot_0")
    assert refused is not None
    assert not statics.changed
    assert statics.tree.lookup_pose2("map", ODOM, 0)[0].x == 1.0
    assert statics.localise(start_pose(5.0, S), "robot_0") is None
    assert statics.changed
    assert statics.xs() == {}
    assert statics.put(Static(Rank.SIMULATOR, start_pose(2.0), "robot_0")) is None
    assert statics.tree.lookup_pose2("map", ODOM, 0)[0].x == 5.0
    assert not statics.changed
    statics.restore_start_poses()
    assert statics.changed
    assert statics.xs() == {ODOM: 2.0}
    assert statics.tree.lookup_pose2("map", ODOM, 0)[0].x == 2.0


def test_an_edge_that_is_said_anew_under_another_parent_goes_first() -> None:
    """Only edges of that source go: those with another parent, or turned round. Edges that it does not repeat stay."""
    statics = Statics()
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
    assert [*statics.xs()] == sorted(statics.tree.frames()) == ["kept", "moved_too", "silent"]


def test_a_source_that_lives_counts_before_one_that_may_have_ended() -> None:
    """The first one that lives holds a frame; when it ends the next one has it, and the first one's return brings it
    back. Of those that do not live, the one that came last counts.
    """
    statics = Statics("sim", "driver")
    for x, source in enumerate(("script", "second", "script", "sim", "driver", "other")):
        statics.say(float(x), source)
        if x == 2:
            assert statics.xs() == {CAMERA: 1.0}
    assert statics.xs() == {CAMERA: 3.0}
    for gone, x in (("sim", 4.0), ("driver", 5.0)):
        statics.living.discard(gone)
        statics.look_again(gone)
        assert statics.xs() == {CAMERA: x}
    statics.living.add("driver")
    statics.look_again("driver")
    assert statics.xs() == {CAMERA: 4.0}


@pytest.mark.parametrize(
    ("first", "second", "x"),
    [
        (Sent(20), Sent(10), 0.2),
        (Sent(10**6, 0.0), Sent(10, 0.0, 2.0), 0.1),
        (Sent(10**9, -3600.0, 1.9), Sent(10, 0.0, 2.0), 0.1),
    ],
    ids=["of before", "set back", "ahead"],
)
def test_what_a_source_said_last_counts(first: Sent, second: Sent, x: float) -> None:
    """A message that was sent earlier and comes later changes nothing, unless the clock of its host was set back since
    or had been ahead; an edge with another parent counts as well."""
    statics = Statics()
    statics.put(Static(Rank.SIMULATOR, camera(0.2), "sim", first))
    later = Static(Rank.SIMULATOR, camera(0.1, "mast"), "sim", second)
    statics.drop_reparented("sim", {CAMERA: later.transform}, later.sent)
    statics.put(later)
    assert statics.xs() == {CAMERA: x}


def test_invented_sources_push_out_none_that_lives() -> None:
    """However many sources come and go, the holder stays, and the next one that lives has the frame after it."""
    statics = Statics("sim", "driver")
    statics.say(1.0, "sim")
    statics.say(2.0, "driver")
    for number in range(3 * MOST_SOURCES):
        statics.say(3.0, str(number))
    assert statics.xs() == {CAMERA: 1.0}
    statics.living.discard("sim")
    statics.look_again("sim")
    assert statics.xs() == {CAMERA: 2.0}
    statics.drop_authority("driver")
    held = 0
    while statics.xs():
        statics.drop_authority(statics.holders[CAMERA].authority)
        held += 1
    assert held < MOST_SOURCES


def test_what_was_withdrawn_stays_so_and_a_description_comes_back() -> None:
    """A source that dropped an edge while another one held it has no part in it any more; a description waits."""
    statics = Statics("sim", "driver")
    for x, source, rank in (
        (1.0, "urdf", Rank.DESCRIPTION),
        (2.0, "sim", Rank.SIMULATOR),
        (3.0, "driver", Rank.CALLER),
    ):
        statics.say(x, source, rank)
    for source, x in (("driver", 2.0), ("sim", 1.0)):
        statics.drop_reparented(source, {CAMERA: camera(x, "arm")})
        assert statics.xs() == {CAMERA: x}


def test_a_frame_that_moves_is_not_made_fixed() -> None:
    """A static transform for a moving frame is refused, and both sources are named: else its samples would be."""
    statics = Statics()
    statics.tree.set_transform(stamped(ODOM, "robot_0/base", S, 1.0), "robot_0")
    refused = statics.put(Static(Rank.SIMULATOR, stamped(ODOM, "robot_0/base", 0), "script"))
    assert refused is not None
    assert refused.text == "robot_0/base moves, by robot_0: the static transform of script is refused"
    assert statics.tree.set_transform(stamped(ODOM, "robot_0/base", 2 * S, 2.0), "robot_0") is None


def test_an_authority_leaves_with_all_its_frames() -> None:
    """Its static transforms leave the message and the buffer; a localiser's data stays."""
    statics = Statics()
    for transform, source in (
        (stamped("map", "table", 0), "tool"),
        (start_pose(1.0), "tool"),
        (stamped("map", "door", 0), "other"),
    ):
        statics.put(Static(Rank.CALLER, transform, source))
    statics.localise(start_pose(5.0, S), "robot_0")
    statics.message()
    statics.drop_authority("tool")
    assert statics.changed
    assert [*statics.xs()] == ["door"]
    assert sorted(statics.tree.frames()) == ["door", ODOM]
