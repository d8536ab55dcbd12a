"""What the kernels of planning refuse: arguments that they would read or write out of bounds for."""

import re
from collections.abc import Callable

import numpy as np
import pytest

from zteam.kernels import navigation
from zteam.kernels.navigation import UNREACHED, Steps

COSTS = np.zeros((6, 8), np.uint8)
WEIGHTS = np.pad(np.ones((4, 6), np.uint8), 1)
WALK = np.array([[1, 1], [2, 1], [3, 2]])
STEPS = Steps(70, 99, 1)
REACHED = np.full((6, 8), UNREACHED, np.uint32)
NOWHERE = np.empty((0, 2), np.int64)
VALUES = np.zeros((4, 5), np.uint16)
PLACE = (0.0, 0.0, 0.0, 1.0)
POSES, BEAMS = np.zeros((3, 3)), np.zeros((2, 4), np.float32)
SIZE = (0.5, 0.5, 0.2)
HERE = (0.0, 0.0, 0.0)
LAYERS = navigation.Layers((6, 8), np.ones((3, 2)), 1.5, np.zeros(5, np.uint8), 1)
NONE, ENOUGH = np.zeros(3, bool), np.array((3,))
REFUSED: dict[str, list[Callable[[], object]]] = {
    "window": [
        lambda: navigation.square_distances(COSTS, (0, 7, 0, 8), 1),
        lambda: navigation.square_distances(COSTS, (3, 2, 0, 8), 1),
        lambda: navigation.square_distances(COSTS, (0, 6, 0, 8), 181),
    ],
    "table": [lambda: navigation.Layers((6, 8), np.zeros((3, 2)), 0.0, np.zeros(4, np.uint8), 1)],
    "outline": [lambda: navigation.Layers((6, 8), np.zeros((3, 3)), 0.0, np.zeros(5, np.uint8), 1)],
    "place": [lambda: LAYERS.lie((0.0, 0.0, 1.0, 0.0, 1e-9, 0.0))],
    "ranges": [lambda: LAYERS.observe((np.ones(1), 0.0, 0.1, 0.0, 9.0, (np.nan, 0.0, 0.0)), HERE, (), 0.0, (2.0, 2.0))],
    "costs": [
        lambda: navigation.square_distances(COSTS[:, ::2], (0, 6, 0, 4), 1),
        lambda: navigation.square_distances(COSTS.ravel(), (0, 6, 0, 4), 1),
        lambda: navigation.search(WEIGHTS, 9, 10, STEPS, REACHED[1:].copy()),
        lambda: navigation.trace(WEIGHTS, 9, 12, STEPS, np.zeros((6, 8), np.uint32)),
    ],
    "ends": [
        lambda: navigation.measure_lines(WEIGHTS, WALK, WALK + 5),
        lambda: navigation.measure_lines(WEIGHTS, WALK, WALK[:2]),
    ],
    "motion": [lambda: navigation.move_poses(POSES.copy(), (0.0, 1.0), POSES)],
    "weights": [lambda: navigation.search(WEIGHTS[1:].copy(), 9, 10, STEPS, REACHED[1:].copy())],
    "steps": [lambda: navigation.search(WEIGHTS, 9, 10, Steps(2, 1, 1), REACHED.copy())],
    "start": [
        lambda: navigation.search(WEIGHTS, 0, 10, STEPS, REACHED.copy()),
        lambda: navigation.search(WEIGHTS, 48, 10, STEPS, REACHED.copy()),
    ],
    "way": [
        lambda: navigation.straighten(WEIGHTS, NOWHERE, 1, 3, 2, 1.0),
        lambda: navigation.straighten(WEIGHTS, WALK, 0, 3, 2, 1.0),
        lambda: navigation.straighten(WEIGHTS, -WALK, 1, 3, 2, 1.0),
    ],
    "points": [
        lambda: navigation.lay_path(WALK * np.nan, 0.0, 0.1),
        lambda: navigation.lay_path(WALK * 1e9, 0.0, 0.1),
    ],
    "neutral": [lambda: navigation.weigh_cells(COSTS, 50, -1, 253, 0, np.zeros((8, 10), np.uint8))],
    "values": [
        lambda: navigation.sum_poses(VALUES[:0], PLACE, POSES, BEAMS),
        lambda: navigation.sum_poses(VALUES, (0.0, 0.0, 0.0, 0.0), POSES, BEAMS),
    ],
    "beams": [lambda: navigation.climb(VALUES, PLACE, POSES.copy(), BEAMS[:1], (1.0, 0.1), 4, 30)],
    "poses": [
        lambda: navigation.sum_poses(VALUES, PLACE, POSES[:, :2].copy(), BEAMS),
        lambda: navigation.resample(POSES, np.ones(3), np.ones(3), ~NONE, ENOUGH, SIZE),
        lambda: navigation.resample(POSES, np.ones(0), np.ones(3), NONE, ENOUGH, SIZE),
        lambda: navigation.find_cluster(POSES, np.ones(3), SIZE, 65),
    ],
}


@pytest.mark.parametrize(("name", "call"), [(name, call) for name, calls in REFUSED.items() for call in calls])
def test_a_kernel_refuses_what_it_would_read_out_of_bounds(name: str, call: Callable[[], object]) -> None:
    """ValueError with one line that names the argument."""
    with pytest.raises(ValueError, match=rf"^[^:\n]*\b{re.escape(name)}\b[^:\n]*: [^\n]*$"):
        call()
