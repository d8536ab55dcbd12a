"""Messages that were refused: a problem while it happens, history when it has not happened for a while."""

from collections.abc import Mapping

from zteam import names
from zteam.bus.receiving import KeyCount
from zteam.diagnosis.facts import Facts, Fault
from zteam.diagnosis.finding import Finding, note, ok, problem

HISTORY_AFTER = 60.0
"""Host seconds without a further refusal after which its cause counts as mended."""
_SHOWN = 5
"""Refusals of the past that are listed."""


def is_recent(count: KeyCount) -> bool:
    """Whether messages are refused now; a process that tells no age is an older zteam, and is believed to refuse."""
    return count.dropped > 0 and (count.last_drop_age is None or count.last_drop_age < HISTORY_AFTER)


def format_refusals(count: KeyCount) -> str:
    """`3 refused, the last one 12 s ago: <reason>`."""
    if not count.dropped:
        return "none refused"
    if count.last_drop_age is None:
        return f"{count.dropped} refused"
    last = "" if count.dropped == 1 else "the last one "
    return f"{count.dropped} refused, {last}{format_age(count.last_drop_age)} ago: {count.last_drop_reason}"


def format_age(seconds: float) -> str:
    """`12 s`, `5 min`, `3 h`."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200.0 else f"{seconds / 3600:.0f} h"


def check_refusals(facts: Facts) -> list[Finding]:
    """One problem for every key on which messages are refused now, with cause and writer; one note for all history."""
    rows = [(key, name, count) for name, key, count in _refusals(facts.counts)]
    if not rows and not facts.faults:
        return [ok("refusals", "no message was refused")]
    recent = [row for row in rows if is_recent(row[2]) and not _lacks_its_robot(facts, row[0])]
    faults = {fault.key: fault for fault in reversed(facts.faults)}
    found = [_of_fault(fault, [r for r in recent if r[0] == key]) for key, fault in sorted(faults.items())]
    unexplained = {row[0]: row for row in reversed(recent) if row[0] not in faults}
    found += [_of_count(facts, *row) for _, row in sorted(unexplained.items())]
    past = [row for row in rows if not is_recent(row[2])]
    if past:
        found.append(_of_history(past))
    return found


def _lacks_its_robot(facts: Facts, key: str) -> bool:
    """Whether the world lacks the robot of a key that has a process: that is told already, as the cause."""
    target = names.split_robot_key(key)
    return (
        target is not None and facts.sim is not None and target[0] in facts.robots and target[0] not in facts.sim.robots
    )


def _refusals(counts: Mapping[str, Mapping[str, KeyCount]]) -> list[tuple[str, str, KeyCount]]:
    return [
        (name, key, count)
        for name, per_key in sorted(counts.items())
        for key, count in per_key.items()
        if count.dropped
    ]


def _of_fault(fault: Fault, refusals: list[tuple[str, str, KeyCount]]) -> Finding:
    by = f"; refused by {', '.join(name for _, name, _ in refusals)}" if refusals else ""
    text = f"{fault.key}: {fault.writer} sends {fault.reason}{by}"
    return problem("refusals", text, "end or mend what sends it: 'zteam node list' has the processes")


def _of_count(facts: Facts, key: str, name: str, count: KeyCount) -> Finding:
    writers = ", ".join(facts.writers.get(key, ()))
    past = f"{HISTORY_AFTER:g} s after the last refusal this is history"
    step = f"look at {writers}, which writes {key} now; {past}" if writers else f"no process writes {key} now; {past}"
    return problem("refusals", f"{key}: {name}: {format_refusals(count)}", step)


def _of_history(rows: list[tuple[str, str, KeyCount]]) -> Finding:
    shown = [f"{key} by {name} ({format_refusals(count)})" for key, name, count in rows[:_SHOWN]]
    more = f", and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    return note("refusals", f"none within {HISTORY_AFTER:g} s; before: {'; '.join(shown)}{more}")
