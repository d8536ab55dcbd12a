"""The buffer against everything that was recorded from tf2 itself."""

from typing import Any

import pytest

from recordings import SETS, tf2
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, ns_from_time, time_from_ns
from zteam.tf import Buffer, TransformException

TOLERANCE = 1e-9


def _stamped(parent: str, child: str, stamp: int, xf: list[float]) -> TransformStamped:
    return TransformStamped(
        Header(time_from_ns(stamp), parent), child, Transform(Vector3(*xf[:3]), Quaternion(*xf[3:]))
    )


def _numbers(transform: TransformStamped) -> list[float]:
    t, r = transform.transform.translation, transform.transform.rotation
    return [t.x, t.y, t.z, r.x, r.y, r.z, r.w]


def _agrees(recorded: list[Any], answer: TransformStamped | TransformException) -> bool:
    if isinstance(answer, TransformException):
        return any(kind.__name__ == recorded[0] for kind in type(answer).__mro__)
    if isinstance(recorded[0], str):
        return False
    ours = _numbers(answer)
    sign = 1.0 if sum(a * b for a, b in zip(ours[3:], recorded[4:], strict=True)) > 0 else -1.0
    ours[3:] = [sign * q for q in ours[3:]]
    close = all(abs(a - b) <= TOLERANCE for a, b in zip(ours, recorded[1:], strict=True))
    return close and ns_from_time(answer.header.stamp) == recorded[0]


def _run(buffer: Buffer, operation: list[Any]) -> bool:
    """Whether one recorded operation comes out as tf2 had it."""
    kind, *arguments, recorded = operation
    if kind in {"set", "static"}:
        put = buffer.set_transform if kind == "set" else buffer.set_transform_static
        refused = put(_stamped(*arguments), "recorded")
        # An exact duplicate is counted silently here (a documented deviation).
        return (refused is None) == (recorded is None) or recorded == "TF_REPEATED_DATA"
    if kind in {"can", "can_full"}:
        can = buffer.can_transform if kind == "can" else buffer.can_transform_full
        return can(*arguments)[0] is recorded
    look_up = buffer.lookup_transform if kind == "lookup" else buffer.lookup_transform_full
    try:
        return _agrees(recorded, look_up(*arguments))
    except TransformException as error:
        return _agrees(recorded, error)


@pytest.mark.parametrize("which", SETS)
def test_every_recorded_case_holds(which: str) -> None:
    """Values to 1e-9, stamps to the nanosecond, the class of every exception and every refusal are tf2's."""
    cases = tf2(which)
    wrong = []
    for case in cases:
        buffer = Buffer(case["cache_s"])
        wrong += [(case["name"], op) for op in case["ops"] if not _run(buffer, op)]
    assert len(cases) == {"own": 43, "full": 117}[which]
    assert wrong == []
