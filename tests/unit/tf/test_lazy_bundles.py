"""Bundles from which only looked-up frames are decoded answer like a buffer that decodes everything."""

import math
import random

import pytest

from support.bundles import ROBOTS, S, bundle
from zteam.errors import DecodeError
from zteam.messages import (
    Header,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    encode,
    time_from_ns,
)
from zteam.tf import Buffer, TransformException
from zteam.tf.lazy_bundles import Bundles


def starts(buffer: Buffer) -> None:
    """Every robot's start pose."""
    for i in range(ROBOTS):
        pose = Transform(Vector3(10.0 * i), Quaternion(0.0, 0.0, 0.0, 1.0))
        for name in ("robot", "rover"):
            buffer.set_transform_static(TransformStamped(Header(frame_id="map"), f"{name}_{i}/odom", pose), "test")


class Pair:
    """One buffer that decodes whole bundles, and one that decodes only looked-up frames."""

    def __init__(self, form: str = "bytes") -> None:
        """`form` of the bundles: bytes, messages, or mixed."""
        self._form = form
        self._count = 0
        self.whole, self.lazy = Buffer(), Buffer()
        starts(self.whole)
        starts(self.lazy)
        self.bundles = Bundles(self.lazy, "test")

    def take(self, transforms: list[TransformStamped]) -> int:
        """Give one bundle to both buffers."""
        for one in transforms:
            self.whole.set_transform(one, "test")
        self._count += 1
        as_bytes = self._form == "bytes" or (self._form == "mixed" and self._count % 3 == 0)
        return self.bundles.take(encode(TFMessage(transforms)) if as_bytes else TFMessage(transforms))

    def look(self, target: str, source: str, time: int = 0) -> list[object]:
        """The answers of the full buffer and of the lazy one, in this order."""
        self.bundles.settle(target, source)
        answers: list[object] = []
        for buffer in (self.whole, self.lazy):
            try:
                answers.append(buffer.lookup_transform(target, source, time))
            except TransformException as error:
                answers.append((type(error), str(error)))
        return answers

    def newest(self, target: str, source: str) -> list[tuple[float, ...] | None]:
        """What both say of the newest planar pose: x, y, yaw and its stamp; None where there is none."""
        try:
            pose, stamp = self.whole.lookup_pose2(target, source, 0)
            whole: tuple[float, ...] | None = (*pose, stamp)
        except TransformException:
            whole = None
        found = self.bundles.find_pose2(target, source)
        return [whole, None if found is None else (*found[0], found[1])]

    def move_start(self, robot: int, x: float) -> None:
        """Place a robot's start pose anew."""
        turned = Transform(Vector3(x, 1.0), Quaternion(0.0, 0.0, 0.6, 0.8))
        fixed = TransformStamped(Header(frame_id="map"), f"robot_{robot}/odom", turned)
        for buffer in (self.whole, self.lazy):
            buffer.set_transform_static(fixed, "test")
        self.bundles.forget_paths()


@pytest.fixture(params=["bytes", "messages", "mixed"])
def pair(request: pytest.FixtureRequest) -> Pair:
    """Two buffers with the start poses, for bundles of each form."""
    return Pair(request.param)


def test_what_is_asked_for_is_what_was_said(pair: Pair) -> None:
    """After any number of bundles, newest and past look-ups between any two robots equal those of a full buffer."""
    chance = random.Random(1)
    for tick in range(1, 400):
        assert pair.take(bundle(tick)) == tick * S // 10
        if chance.random() < 0.1:
            a, b = chance.sample(range(ROBOTS), 2)
            past = max(1, tick - chance.randrange(90)) * S // 10
            for time in (0, past):
                whole, lazy = pair.look(f"robot_{a}/base_footprint", f"robot_{b}/base_footprint", time)
                assert whole == lazy


def turn(transforms: list[TransformStamped], chance: random.Random) -> None:
    """Give every robot some yaw."""
    for one in transforms:
        yaw = chance.uniform(-3.0, 3.0)
        one.transform.rotation = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


def spoil(fault: str, tick: int, transforms: list[TransformStamped], chance: random.Random) -> None:
    """Let a bundle differ from the one before in more than its poses and its stamp."""
    one = chance.choice(transforms)
    other = time_from_ns(max(1, tick + chance.choice([-30, -1, 1, 2])) * S // 10)
    match fault:
        case "one stamp":
            one.header.stamp = other
        case "all stamps":
            for each in transforms:
                each.header.stamp = other
        case "rotation":
            one.transform.rotation = Quaternion(0.0, 0.0, 0.0, chance.choice([0.5, 0.9999]))
        case "height":
            one.transform.translation.z = chance.choice([0.0, 0.25])
        case "tilt":
            one.transform.rotation = Quaternion(0.6, 0.0, 0.0, 0.8)
        case "parent":
            one.header.frame_id = chance.choice(["map", one.child_frame_id, "/" + one.header.frame_id])


@pytest.mark.few(12)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("fault", ["", "one stamp", "all stamps", "rotation", "height", "tilt", "parent", "start"])
def test_newest_poses_are_those_of_a_full_buffer(pair: Pair, fault: str, seed: int) -> None:
    """Newest poses equal a full buffer's to the last bit, also with old, raised and refused transforms.

    After a tilted one, a full buffer rounds in another way.
    """
    chance = random.Random(seed)
    for tick in range(1, 200):
        transforms = bundle(tick)
        turn(transforms, chance)
        # The same fault for six ticks, and another one for a single tick.
        spoilt = tick // 6 % 5 == 4 or tick % 30 == 10
        if spoilt:
            spoil(fault, tick, transforms, random.Random(seed + tick // 6))
        pair.take(transforms)
        if spoilt and fault == "start":
            pair.move_start(chance.randrange(ROBOTS), chance.uniform(-5.0, 5.0))
        for _ in range(chance.choice([0, 1, 40])):
            a, b = chance.sample(range(ROBOTS), 2)
            target = chance.choice(["map", f"robot_{a}/base_footprint", "nowhere"])
            whole, lazy = pair.newest(target, f"robot_{b}/base_footprint")
            assert lazy == (pytest.approx(whole, abs=1e-9) if fault == "tilt" else whole)


@pytest.mark.parametrize("form", ["bytes", "messages"])
def test_newest_poses_need_no_buffer(form: str) -> None:
    """Newest poses are read from the newest bundle, and a later past look-up still finds all bundles."""
    pair = Pair(form)
    for tick in range(1, 51):
        pair.take(bundle(tick))
        whole, lazy = pair.newest("robot_0/base_footprint", "robot_1/base_footprint")
        assert whole == lazy
    assert pair.lazy.frames()["robot_1/base_footprint"].samples == 1
    whole_answer, lazy_answer = pair.look("map", "robot_1/base_footprint", 2 * S)
    assert whole_answer == lazy_answer
    assert pair.lazy.frames()["robot_1/base_footprint"].samples == 50


@pytest.mark.parametrize("change", ["x", "y", "yaw", "start"])
def test_a_robot_that_stood_is_seen_to_move(pair: Pair, change: str) -> None:
    """Newest poses follow the smallest change in one number, or in the start pose, after ticks without any."""
    frames = "robot_0/base_footprint", "robot_1/base_footprint"
    for tick in range(1, 20):
        transforms = bundle(1)
        for one in transforms:
            one.header.stamp = time_from_ns(tick * S // 10)
        pose, change_so_far = transforms[1].transform, 1e-12 * (tick // 3)
        match change:
            case "x":
                pose.translation.x += change_so_far
            case "y":
                pose.translation.y += change_so_far
            case "yaw":
                pose.rotation = Quaternion(0.0, 0.0, math.sin(change_so_far), math.cos(change_so_far))
        pair.take(transforms)
        if change == "start" and tick % 3 == 0:
            pair.move_start(1, change_so_far)
        for target in ("map", *frames):
            for source in frames:
                whole, lazy = pair.newest(target, source)
                assert lazy == whole


def test_receivers_of_the_same_messages_have_their_own_start_poses() -> None:
    """What one receiver found is not taken for another's whose start poses differ, or differ from some tick on."""
    pairs = [Pair("messages") for _ in range(3)]
    pairs[1].move_start(1, 3.0)
    for tick in range(1, 30):
        message = TFMessage(bundle(tick // 4))
        for one in message.transforms:
            one.header.stamp = time_from_ns(tick * S // 10)
        if tick == 20:
            pairs[0].move_start(1, -3.0)
        for pair in pairs:
            for one in message.transforms:
                pair.whole.set_transform(one, "test")
            pair.bundles.take(message)
            for target in ("map", "robot_0/base_footprint"):
                whole, lazy = pair.newest(target, "robot_1/base_footprint")
                assert lazy == whole


def test_newest_poses_start_anew(pair: Pair) -> None:
    """After a jump back, newest poses are those from after it."""
    for ticks in (range(50, 60), range(1, 5)):
        for tick in ticks:
            pair.take(bundle(tick))
            whole, lazy = pair.newest("map", "robot_3/base_footprint")
            assert whole == lazy
        for forget in (pair.bundles.clear, pair.whole.clear, pair.lazy.clear):
            forget()


def test_other_frames_are_noticed(pair: Pair) -> None:
    """Answers stay right when robots come and go, and with another order or other names of the same length."""
    shapes = [range(ROBOTS), range(3), [4, 3, 2, 1, 0], [0, 2, 4]]
    for tick in range(1, 200):
        name = "rover" if tick // 25 % 2 else "robot"
        pair.take(bundle(tick, shapes[tick // 10 % len(shapes)], name))
        if tick % 7 == 0:
            for name in ("robot", "rover"):
                whole, lazy = pair.look("map", f"{name}_2/base_footprint")
                assert whole == lazy


def test_another_robot_in_the_middle_is_noticed(pair: Pair) -> None:
    """Robots 1 and 2 alternate in bundles of equal length, and each one's newest pose is found after each bundle."""
    for tick in range(1, 41):
        pair.take(bundle(tick, [0, 1 + tick % 2, 3]))
        for robot in (1, 2):
            whole, lazy = pair.look("map", f"robot_{robot}/base_footprint")
            assert whole == lazy


def test_robots_that_miss_some_bundles_are_seen(pair: Pair) -> None:
    """Look-ups are right when each robot is in 85 % of the bundles and each bundle has its own order."""
    chance = random.Random(3)
    for tick in range(1, 400):
        present = [robot for robot in range(ROBOTS) if chance.random() < 0.85]
        if chance.random() < 0.3:
            chance.shuffle(present)
        pair.take(bundle(tick, present))
        a, b = chance.sample(range(ROBOTS), 2)
        for time in (0, max(1, tick - chance.randrange(60)) * S // 10):
            whole, lazy = pair.look(f"robot_{a}/base_footprint", f"robot_{b}/base_footprint", time)
            assert whole == lazy


def test_names_may_have_a_leading_slash(pair: Pair) -> None:
    """Frames that a bundle names with a leading slash are found under their plain names, in every bundle."""
    for tick in range(1, 5):
        transforms = bundle(tick)
        for one in transforms:
            one.child_frame_id = "/" + one.child_frame_id
        pair.take(transforms)
        whole, lazy = pair.look("map", "robot_2/base_footprint")
        assert whole == lazy


@pytest.mark.parametrize("form", ["bytes", "messages"])
def test_frames_that_are_not_looked_up_are_not_read(form: str) -> None:
    """The buffer holds all samples of the two looked-up robots, and only the first sample of the others."""
    pair = Pair(form)
    for tick in range(1, 51):
        pair.take(bundle(tick))
        pair.look("robot_0/base_footprint", "robot_1/base_footprint")
    counts = {child: info.samples for child, info in pair.lazy.frames().items() if child.endswith("base_footprint")}
    assert counts == {f"robot_{i}/base_footprint": 50 if i < 2 else 1 for i in range(ROBOTS)}


@pytest.mark.few(1)
def test_old_bundles_go(pair: Pair) -> None:
    """Old bundles are dropped: after an hour, a look-up reaches back as far as a buffer does."""
    for tick in range(1, 36_000):
        pair.bundles.take(encode(TFMessage(bundle(tick, [0]))))
    pair.bundles.settle("map", "robot_0/base_footprint")
    info = pair.lazy.frames()["robot_0/base_footprint"]
    assert info.newest == 35_999 * S // 10
    assert info.samples <= 200


def test_time_starts_anew(pair: Pair) -> None:
    """After a jump back, no data from before it is found."""
    for tick in range(50, 60):
        pair.take(bundle(tick))
    pair.bundles.clear()
    pair.whole.clear()
    pair.lazy.clear()
    for tick in range(1, 5):
        pair.take(bundle(tick))
    whole, lazy = pair.look("map", "robot_3/base_footprint")
    assert whole == lazy


@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 60])
def test_garbage_is_refused(pair: Pair, payload: bytes) -> None:
    """A payload that is no bundle raises DecodeError and leaves the kept bundles unchanged."""
    pair.take(bundle(1))
    with pytest.raises(DecodeError):
        pair.bundles.take(payload)
    whole, lazy = pair.look("map", "robot_1/base_footprint")
    assert whole == lazy


def test_garbage_of_the_right_length_moves_no_robot() -> None:
    """Random bytes of a bundle's length, a bundle with a damaged beginning, and NaN change no answer."""
    pair = Pair("bytes")
    pair.take(bundle(1))
    length = len(encode(TFMessage(bundle(1))))
    with pytest.raises(DecodeError):
        pair.bundles.take(b"\0\1\0\0" + b"\xff" * (length - 4))
    torn = bytearray(encode(TFMessage(bundle(2))))
    torn[8:60] = b"\xff" * 52
    with pytest.raises(DecodeError):
        pair.bundles.take(bytes(torn))
    broken = bytearray(encode(TFMessage(bundle(3))))
    broken[-56:] = b"\xff" * 56
    pair.bundles.take(bytes(broken))
    for robot in range(ROBOTS):
        pair.bundles.settle("map", f"robot_{robot}/base_footprint")
    newest = {child: info.newest for child, info in pair.lazy.frames().items() if child.endswith("base_footprint")}
    assert newest == {f"robot_{i}/base_footprint": (1 if i == ROBOTS - 1 else 3) * S // 10 for i in range(ROBOTS)}


def test_an_empty_bundle_says_nothing(pair: Pair) -> None:
    """An empty bundle gives the stamp 0 and changes nothing."""
    assert pair.take([]) == 0
    pair.take(bundle(1))
    assert pair.take([]) == 0
    whole, lazy = pair.look("map", "robot_1/base_footprint")
    assert whole == lazy
