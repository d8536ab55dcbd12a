"""The figures of a view: how old frames are, memory, slow pages, its cost for a run in lock-step, and the drawing."""

import statistics
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from studies.launching import launch
from studies.view.browser import DrawFigures, StartFigures, measure_drawing, measure_start
from studies.view.page import FoxgloveFigures, FrameFigures, Page, measure_foxglove
from studies.view.stage import TOKEN, crowd, start_view, team
from zteam.cli.bench import figure, run_processes, write_line_team
from zteam.cli.tables import format_table
from zteam.config.numbers import counted
from zteam.errors import ZteamError
from zteam.team.run.report import RunReport

PARTS = ("load", "slow", "many", "cost", "foxglove", "browser", "start")
SLOW_FRAME = 0.5
"""Host seconds that a slow page takes a frame."""
MANY, STARTS = 10, 5
"""Pages at once; starts of a team for each figure."""
COST_RUN = 300
"""Simulated seconds of a run in lock-step: six seconds of the host, so that its beginning counts little."""
BEAMS = {4: 360, 100: 360, 1000: 90}
"""Beams of a scan by the number of robots."""

Progress = Callable[[str], None]


class LoadFigures(msgspec.Struct):
    """One page at a view of so many robots."""

    robots: int
    page: FrameFigures
    pss_mb: float
    rss_mb: float


class CostFigures(msgspec.Struct):
    """A run in lock-step without and with one page, in turn."""

    alone: list[float]
    """Real-time factors."""
    watched: list[float]
    slow_down: float
    """Median over the pairs of 1 - watched / alone."""
    same_trajectory: bool


class ViewFigures(msgspec.Struct):
    """All of them; empty or None for what was not measured."""

    loads: list[LoadFigures] = []
    slow: list[FrameFigures] = []
    """Two pages at one view: a fast one, and one that takes 0.5 s a frame."""
    cost: CostFigures | None = None
    drawings: list[DrawFigures] = []
    many: list[FrameFigures] = []
    """Of ten pages at once at one view."""
    foxglove: FoxgloveFigures | None = None
    start: StartFigures | None = None
    no_browser: str = ""
    """Why nothing was drawn."""


def measure_view(world: Path, seconds: float, pairs: int, parts: tuple[str, ...], progress: Progress) -> ViewFigures:
    """Measure `parts` of PARTS; a load for `seconds`, the cost in so many pairs."""
    figures = ViewFigures()
    if "load" in parts:
        for robots in (4, 100):
            progress(f"one page, {robots} robots")
            figures.loads.append(_measure_load(robots, seconds))
    if "slow" in parts:
        progress("a slow page beside a fast one")
        figures.slow = _measure_pages(seconds, [0.0, SLOW_FRAME])
    if "many" in parts:
        progress(f"{MANY} pages at once")
        figures.many = _measure_pages(seconds, [0.0] * MANY)
    if "cost" in parts:
        figures.cost = _measure_cost(world, pairs, progress)
    if "foxglove" in parts:
        progress("a client of Foxglove's protocol, 20 robots")
        figures.foxglove = measure_foxglove(seconds)
    try:
        for robots in (100, 1000) if "browser" in parts else ():
            progress(f"a browser, {robots} robots")
            with crowd(robots, BEAMS[robots]) as stage:
                figures.drawings.append(measure_drawing(stage.url, robots, BEAMS[robots], seconds))
        if "start" in parts:
            progress("from the command to a drawn robot")
            figures.start = measure_start(STARTS)
    except ZteamError as error:
        figures.no_browser = str(error)
    return figures


def _measure_load(robots: int, seconds: float) -> LoadFigures:
    """One page: with 4 robots of a whole team, with more of the simulator alone."""
    with team("line") if robots == 4 else crowd(robots, BEAMS[robots]) as stage:
        page = Page(stage.port, TOKEN, seconds)
        page.start()
        figures = page.figures()
        usage = stage.view_usage()
        return LoadFigures(robots, figures, round(usage.pss_mb, 1), round(usage.rss_mb, 1))


def _measure_pages(seconds: float, delays: list[float]) -> list[FrameFigures]:
    """Pages at one view of a team of four, which take so many seconds a frame."""
    with team("line") as stage:
        pages = [Page(stage.port, TOKEN, seconds, delay=delay) for delay in delays]
        for page in pages:
            page.start()
        return [page.figures() for page in pages]


def _measure_cost(world: Path, pairs: int, progress: Progress) -> CostFigures:
    """Runs of a line of four robots in lock-step, as fast as they go, alone and watched by one page, in turn."""
    alone: list[float] = []
    watched: list[float] = []
    hashes = set()
    for pair in range(pairs):
        # The first run of a pair is another one each time: the machine may become faster or slower meanwhile.
        for is_watched in (False, True) if pair % 2 == 0 else (True, False):
            progress(f"lock-step, pair {pair + 1} of {pairs}, {'watched' if is_watched else 'alone'}")
            report = _run(world, is_watched)
            (watched if is_watched else alone).append(report.real_time_factor or 0.0)
            hashes.add(report.trajectory_sha256)
    ratios = [1.0 - seen / unseen for unseen, seen in zip(alone, watched, strict=True)]
    return CostFigures(alone, watched, statistics.median(ratios), len(hashes) == 1)


def _run(world: Path, is_watched: bool) -> RunReport:
    with TemporaryDirectory() as name, launch() as processes:
        folder, endpoint = Path(name), processes.start_router()
        file = write_line_team(world, 4, 1081, folder)
        page = Page(start_view(processes, endpoint), TOKEN, 600.0)
        if is_watched:
            page.start()
        words = [str(file), "--lockstep", "--for", str(COST_RUN), "--connect", endpoint]
        report = run_processes(words, folder, world, COST_RUN)
        page.stop()
        return report


def format_view(found: ViewFigures) -> str:
    """One table a part that was measured."""
    parts = []
    pages = [(counted(load.robots, "robot"), load.page) for load in found.loads]
    pages += zip(("4 robots, beside a slow page", "the slow page"), found.slow, strict=False)
    if found.many:
        oldest = max(found.many, key=lambda page: page.age_p95 or 0.0)
        pages.append((f"the worst of {len(found.many)} pages, 4 robots", oldest))
    if pages:
        head = ("page", "frames/s", "kB/s", "age, ms", "95 %", "oldest", "longest gap, ms")
        # All but the last field, the lasers that were seen.
        body = [(name, *map(figure, msgspec.structs.astuple(page)[:-1])) for name, page in pages]
        parts.append(format_table(head, body, numbers_from=1))
    for load in found.loads:
        parts.append(
            f"memory with {counted(load.robots, 'robot')}: {load.pss_mb} MB (PSS), {load.rss_mb} MB (resident)"
        )
    if (cost := found.cost) is not None:
        rows = [
            (str(number), figure(alone), figure(seen), f"{100 * (1 - seen / alone):.1f} %")
            for number, (alone, seen) in enumerate(zip(cost.alone, cost.watched, strict=True), 1)
        ]
        table = format_table(("pair", "alone", "watched", "slower by"), rows, numbers_from=1)
        same = "the same trajectory in all runs" if cost.same_trajectory else "NOT the same trajectory in all runs"
        parts.append(
            f"A line of four robots in lock-step, real-time factors:\n{table}\n"
            f"slower by {100 * cost.slow_down:.1f} % (median of the pairs); {same}"
        )
    if (client := found.foxglove) is not None:
        parts.append(
            f"Foxglove's protocol, 20 robots: {client.messages_per_s:.0f} scans/s, {client.kilobytes_per_s:.0f} kB/s "
            f"for {100 * client.cores:.1f} % of a core ({100 * client.idle_cores:.1f} % without a subscription), "
            f"{client.rss_mb} MB (resident)"
        )
    if found.drawings:
        titles = (
            "browser", "pictures/s", "JavaScript, ms of a processor", "JavaScript, ms", "95 %", "age on arrival",
            "95 %", "when drawn", "95 %",
        )  # fmt: skip
        drawn = []
        for each in found.drawings:
            spreads = [value for spread in (each.js_ms, each.arrival_ms, each.age_ms) for value in spread]
            numbers = map(figure, (each.frames_per_s, each.script_ms, *spreads))
            drawn.append((f"{each.robots} robots, {each.beams} beams", *numbers))
        parts.append(format_table(titles, drawn, numbers_from=1))
    if (start := found.start) is not None:
        parts.append(
            f"from 'zteam up line --view' to a drawn robot: {start.open_browser:.2f} s in an open browser, "
            f"{start.new_window:.2f} s in a new window, {start.new_user:.2f} s there if it has never seen the page, "
            f"{start.new_browser:.2f} s with the browser's own start; the address is printed after {start.said:.2f} s"
        )
    if found.no_browser:
        parts.append(f"no browser: {found.no_browser}")
    return "\n\n".join(parts)
