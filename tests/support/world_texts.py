"""World files that a test writes as text."""

from collections.abc import Callable
from pathlib import Path

from zteam.world import Shape, World, load_world

LoadText = Callable[..., World]
"""The function that `text_loader` makes."""


def text_loader(folder: Path) -> LoadText:
    """A function that loads the text of a world from a file in `folder`, with a robot added at its end."""

    def load_text(text: str, robot: str = "\nposition ()", *, whole_bitmaps: bool = False) -> World:
        path = folder / "w.world"
        path.write_text(text + robot)
        return load_world(path, whole_bitmaps=whole_bitmaps)

    return load_text


def box_points(half: float) -> tuple[tuple[float, float], ...]:
    """The corners of a square of 2 * `half` about the origin."""
    return ((-half, -half), (half, -half), (half, half), (-half, half))


def box_of(shape: Shape) -> tuple[float, float, float, float]:
    """The smallest and largest x and y of a shape: left, bottom, right, top."""
    xs, ys = zip(*shape.points, strict=True)
    return (min(xs), min(ys), max(xs), max(ys))
