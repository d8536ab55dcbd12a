"""The figures of the study `view` as tables."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from zteam.cli.bench import figure
from zteam.cli.tables import format_table
from zteam.config.numbers import counted

if TYPE_CHECKING:
    from studies.view.browser import DrawFigures
    from studies.view.figures import CostFigures, ViewFigures
    from studies.view.page import FrameFigures
    from studies.view.starting import StartFigures

_HEAD = ("page", "frames/s", "kB/s", "age, ms", "95 %", "oldest", "longest gap, ms")


def format_view(found: "ViewFigures") -> str:
    """One table a part that was measured."""
    parts = []
    pages = [(counted(load.robots, "robot"), load.page) for load in found.loads]
    if found.slow is not None:
        pages += [("4 robots, beside a slow page", found.slow.fast), ("the slow page", found.slow.slow)]
    if found.many:
        oldest = max(found.many, key=lambda page: page.age_p95 or 0.0)
        pages.append((f"the worst of {len(found.many)} pages, 4 robots", oldest))
    if pages:
        parts.append(format_table(_HEAD, [_frames(name, page) for name, page in pages], numbers_from=1))
    for load in found.loads:
        parts.append(
            f"memory with {counted(load.robots, 'robot')}: {load.pss_mb} MB (PSS), {load.rss_mb} MB (resident)"
        )
    if found.cost is not None:
        parts.append(_cost(found.cost))
    if (client := found.foxglove) is not None:
        parts.append(
            f"Foxglove's protocol, 20 robots: {client.messages_per_s:.0f} scans/s, {client.kilobytes_per_s:.0f} kB/s "
            f"for {100 * client.cores:.1f} % of a core ({100 * client.idle_cores:.1f} % without a subscription), "
            f"{client.rss_mb} MB (resident)"
        )
    if found.drawings:
        head = (
            "browser", "pictures/s", "JavaScript, ms of a processor", "JavaScript, ms", "95 %", "age on arrival",
            "95 %", "when drawn", "95 %",
        )  # fmt: skip
        body = [
            (
                f"{each.robots} robots, {each.beams} beams",
                *map(figure, (each.frames_per_s, each.script_ms)),
                *_spreads(each),
            )
            for each in found.drawings
        ]
        parts.append(format_table(head, body, numbers_from=1))
    if found.start is not None:
        parts.append(_start(found.start))
    if found.no_browser:
        parts.append(f"no browser: {found.no_browser}")
    return "\n\n".join(parts)


def _spreads(drawing: "DrawFigures") -> Iterator[str]:
    for spread in (drawing.js_ms, drawing.arrival_ms, drawing.age_ms):
        yield from (figure(spread.p50), figure(spread.p95))


def _frames(name: str, page: "FrameFigures") -> tuple[str, ...]:
    return (
        name, figure(page.frames_per_s), figure(page.kilobytes_per_s), figure(page.age_p50), figure(page.age_p95),
        figure(page.age_max), figure(page.gap_max),
    )  # fmt: skip


def _start(start: "StartFigures") -> str:
    return (
        f"from 'zteam up line --view' to a drawn robot: {start.open_browser:.2f} s in an open browser, "
        f"{start.new_window:.2f} s in a new window, {start.new_user:.2f} s there if it has never seen the page, "
        f"{start.new_browser:.2f} s with the browser's own start; the address is printed after {start.said:.2f} s"
    )


def _cost(cost: "CostFigures") -> str:
    pairs = [
        (str(number), figure(alone), figure(seen), f"{100 * (1 - seen / alone):.1f} %")
        for number, (alone, seen) in enumerate(zip(cost.alone, cost.watched, strict=True), 1)
    ]
    table = format_table(("pair", "alone", "watched", "slower by"), pairs, numbers_from=1)
    same = "the same trajectory in all runs" if cost.same_trajectory else "NOT the same trajectory in all runs"
    return (
        f"A line of four robots in lock-step, real-time factors:\n{table}\n"
        f"slower by {100 * cost.slow_down:.1f} % (median of the pairs); {same}"
    )
