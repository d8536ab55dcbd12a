"""The buffer gives the results that were recorded from tf2 itself."""

from typing import Any

import pytest

from support.recordings import SETS, tf2
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, ns_from_time, time_from_ns
from zteam.tf import Buffer, TransformException

TOLERANCE = 1e-9


def stamped(parent: str, child: str, stamp: int, xf: list[float]) -> TransformStamped:
    """`xf` is x, y, z, qx, qy, qz, qw."""
    transform = Transform(Vector3(*xf[:3]), Quaternion(*xf[3:]))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, transform)


def agrees(recorded: list[Any], answer: TransformStamped | TransformException) -> bool:
    """Whether an answer is the recorded one: stamp, seven numbers to TOLERANCE, or the class of the exception."""
    if isinstance(answer, TransformException):
        return any(kind.__name__ == recorded[0] for kind in type(answer).__mro__)
    if isinstance(recorded[0], str):
        return False
    t, r = answer.transform.translation, answer.transform.rotation
    turn = r.x, r.y, r.z, r.w
    sign = 1.0 if sum(a * b for a, b in zip(turn, recorded[4:], strict=True)) > 0 else -1.0
    ours = t.x, t.y, t.z, *(sign * q for q in turn)
    close = all(abs(a - b) <= TOLERANCE for a, b in zip(ours, recorded[1:], strict=True))
    return close and ns_from_time(answer.header.stamp) == recorded[0]


def _run(buffer: Buffer, operation: list[Any]) -> bool:
    """Whether the buffer's result of one recorded operation equals tf2's."""
    kind, *arguments, recorded = operation
    if kind in {"set", "static"}:
        put = buffer.set_transform if kind == "set" else buffer.set_transform_static
        refused = put(stamped(*arguments), "recorded")
        # An exact duplicate is counted silently here (a documented deviation).
        return (refused is None) == (recorded is None) or recorded == "TF_REPEATED_DATA"
    if kind in {"can", "can_full"}:
        can = buffer.can_transform if kind == "can" else buffer.can_transform_full
        return can(*arguments)[0] is recorded
    look_up = buffer.lookup_transform if kind == "lookup" else buffer.lookup_transform_full
    try:
        return agrees(recorded, look_up(*arguments))
    except TransformException as error:
        return agrees(recorded, error)


@pytest.mark.parametrize("which", SETS)
def test_every_recorded_case_holds(which: str) -> None:
    """Values agree to 1e-9, stamps to the nanosecond; exceptions and refusals are tf2's."""
    cases = tf2(which)
    wrong = []
    for case in cases:
        buffer = Buffer(case["cache_s"])
        wrong += [(case["name"], op) for op in case["ops"] if not _run(buffer, op)]
    assert len(cases) == {"own": 43, "full": 117}[which]
    assert wrong == []
