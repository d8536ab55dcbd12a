"""What is subscribed to for what the pages look at, and a page's state: credit, what it has, what it sees."""

from zteam.geometry import Pose2
from zteam.view.received import (
    MAX_SCANNED,
    REACH,
    Drawables,
    Received,
    Viewer,
    robots_in_sight,
    topics_of,
)
from zteam.view.requests import MAX_WATCHES, Ack, Look, Watch

POSES = {0: Pose2(0.0, 0.0, 0.0), 1: Pose2(5.0, 0.0, 0.0), 2: Pose2(50.0, 0.0, 0.0)}


def make_drawables(*keys: str) -> Drawables:
    """These keys are published, and no message has come."""
    return Drawables(keys, Received(lambda: None))


def viewer(look: Look) -> Viewer:
    """A page that looks."""
    made = Viewer(1, may_command=False)
    made.look = look
    return made


def keys(*viewers: Viewer, aggregator: bool = True) -> set[str]:
    """What is subscribed to for these pages."""
    return {topic.key for topic in topics_of(viewers, POSES, make_drawables(), aggregator=aggregator)}


def test_without_a_page_there_is_nothing() -> None:
    """No key at all."""
    assert keys() == set()


def test_scans_are_those_of_robots_in_sight() -> None:
    """And of the selected ones, and of the one that is followed."""
    view = [-1.0, -1.0, 1.0, 1.0]
    assert {key for key in keys(viewer(Look(view, ["scans"]))) if "scan" in key} == {
        "robot_0/base_scan$*", "robot_1/base_scan$*",
    }  # fmt: skip
    selected = keys(viewer(Look([90.0, 90.0, 91.0, 91.0], ["scans"], selected=[2], follow=1)))
    assert {key for key in selected if "scan" in key} == {"robot_1/base_scan$*", "robot_2/base_scan$*"}


def test_layers_that_are_off_cost_nothing() -> None:
    """Sonars, fiducials, goals and costs of selected robots are subscribed to only when they are shown."""
    plain = keys(viewer(Look()))
    assert not any("scan" in key or "sonar" in key or "goal" in key or "log" in key for key in plain)
    shown = keys(viewer(Look(layers=["sonars", "fiducials", "goals"], docs=["log"])))
    assert {"robot_0/sonar$*", "robot_0/fiducials", "robot_$*/goal_pose", "*/log"} <= shown
    costs = keys(viewer(Look(layers=["costs"], selected=[1])))
    assert {key for key in costs if "costmap" in key} == {"robot_1/global_costmap/costmap"}


def test_an_inspected_robot_is_heard_whole() -> None:
    """The sensors of the first selected robot, each message of them, and goals, while its panel is open."""
    shown = topics_of([viewer(Look(selected=[1, 2], docs=["inspect"]))], POSES, make_drawables(), aggregator=True)
    heard = {topic.key for topic in shown if topic.every}
    assert {"robot_1/odom$*", "robot_1/base_scan$*", "robot_1/sonar$*"} <= heard
    assert not any(key.startswith("robot_2") for key in heard)
    assert "robot_$*/goal_pose" in {topic.key for topic in shown}


def test_poses_come_from_the_transforms_if_there_is_an_aggregator() -> None:
    """Else from the simulator's ground truth; never from both."""
    assert "tf" in keys(viewer(Look()))
    assert keys(viewer(Look()), aggregator=False) >= {"robot_$*/base_pose_ground_truth"}
    assert "tf" not in keys(viewer(Look()), aggregator=False)


def test_two_pages_share_their_subscriptions() -> None:
    """What both look at is subscribed to once, what one watches is there too."""
    first, second = viewer(Look()), viewer(Look())
    second.on_watch(Watch("robot_0/odom"))
    assert keys(first, second) == keys(first) | {"robot_0/odom"}


def test_of_a_crowd_only_the_nearest_are_scanned() -> None:
    """The selected ones are always among them."""
    crowd = {i: Pose2(float(i), 0.0, 0.0) for i in range(3 * MAX_SCANNED)}
    last = 3 * MAX_SCANNED - 1
    seen = robots_in_sight(viewer(Look([-1.0, -1.0, 400.0, 1.0], selected=[last])), crowd)
    assert len(seen) == MAX_SCANNED
    assert last in seen
    assert {200, 150, 220} <= {*seen}
    assert 0 not in seen


def test_a_key_whose_type_is_known_is_drawn_before_a_message_comes() -> None:
    """What zteam's own navigation publishes belongs to its layer; other keys of zteam to none."""
    drawables = make_drawables("robot_0/plan", "robot_0/local_costmap/costmap", "robot_0/odom", "own/path", "map")
    assert drawables.of("plans") == ["robot_0/plan"]
    assert drawables.of("costmaps") == ["robot_0/local_costmap/costmap"]
    assert [topic.key for topic in drawables.topics(["particles"])] == ["own/path"]


def test_a_page_has_credit_for_two_frames() -> None:
    """Two that are not acknowledged hold the next one back; what it was never sent does not count."""
    page = viewer(Look())
    first, second = page.next_frame(10.0), 0
    assert page.has_credit
    second = page.next_frame(10.1)
    assert not page.has_credit
    page.on_ack(Ack(second + 1))
    assert not page.has_credit
    page.on_ack(Ack(first))
    assert page.has_credit
    page.on_ack(Ack(second))
    page.next_frame(10.2)
    assert page.has_credit


def test_a_page_is_sent_each_version_once() -> None:
    """It lacks a thing until it has that version."""
    page = viewer(Look())
    assert [page.lacks("map", version) for version in (1, 1, 2, 2, 1)] == [True, False, True, False, True]


def test_a_page_sees_what_is_in_its_viewport() -> None:
    """Without a viewport it sees everything."""
    page = viewer(Look())
    assert page.sees(1e5, 0.0)
    page.look = Look(viewport=[0.0, 0.0, 2.0, 1.0])
    assert (page.sees(2.0, 1.0), page.sees(2.1 + REACH, 0.5)) == (True, False)


def test_a_page_watches_a_bounded_number_of_topics() -> None:
    """One more is not watched."""
    page = viewer(Look())
    for number in range(MAX_WATCHES + 1):
        page.on_watch(Watch(f"topic_{number}"))
    assert len(page.watches) == MAX_WATCHES
