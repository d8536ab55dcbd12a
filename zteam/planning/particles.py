"""Particles: how they move, and how the next ones are drawn."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.planning.grid import Frame
from zteam.planning.jit import compiled, plainly
from zteam.planning.sines import cosine_sine

Floats = NDArray[np.float64]
Bins = NDArray[np.int64]

BIN_SIZE = 0.5, 0.5, math.radians(10.0)
"""Of the histogram that says how spread out the particles are (amcl's pf_kdtree): metres, metres, radians."""
STEP_X, STEP_Y = 1 << 34, 1 << 6
"""From a bin's number to that of its neighbours along x and y: 64 bins of a turn, and 2^28 along y."""
EMPTY = -(1 << 63)
"""No bin, in a hash table."""


def _roll_numpy(poses: Floats, turns: tuple[float, float], errors: tuple[float, float], way: float, ahead: float,
                draws: Floats) -> None:  # fmt: skip
    """The same without numba."""
    begun = poses[:, 2] + (turns[0] - errors[0] * draws[:, 0])
    length = way - ahead * draws[:, 1]
    cos, sin = cosine_sine(begun)
    poses[:, 0] += length * cos
    poses[:, 1] += length * sin
    poses[:, 2] = begun + (turns[1] - errors[1] * draws[:, 2])


@plainly(_roll_numpy)
@compiled
def _roll(poses: Floats, turns: tuple[float, float], errors: tuple[float, float], way: float, ahead: float,
          draws: Floats) -> None:  # fmt: skip
    """Turn, drive and turn: particles (n, 3) in place. `errors` and `ahead` are deviations of the turns and the way."""
    for i in range(poses.shape[0]):
        begun = poses[i, 2] + (turns[0] - errors[0] * draws[i, 0])
        length = way - ahead * draws[i, 1]
        cos, sin = cosine_sine(begun)
        poses[i, 0] += length * cos
        poses[i, 1] += length * sin
        poses[i, 2] = begun + (turns[1] - errors[1] * draws[i, 2])


def move_differential(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """Move particles (n, 3) as odometry says that a differential base went, with its errors.

    amcl's DifferentialMotionModel (Thrun, Burgard, Fox 2005, table 5.6); `draws` (n, 3) are standard normal.
    """
    dx, dy = after.x - before.x, after.y - before.y
    way, turn = math.hypot(dx, dy), normalize_angle(after.yaw - before.yaw)
    # A turn on the spot has no direction of its own.
    first = normalize_angle(math.atan2(dy, dx) - before.yaw) if way >= 0.01 else 0.0
    second = normalize_angle(turn - first)
    # A robot that backs up turns by nearly half a turn before and after: that is no turn.
    small_first, small_second = (min(abs(a), abs(normalize_angle(a - math.pi))) for a in (first, second))
    a1, a2, a3, a4 = alphas[:4]
    squares = a1 * small_first**2 + a2 * way**2, a1 * small_second**2 + a2 * way**2
    ahead = math.sqrt(a3 * way**2 + a4 * (small_first**2 + small_second**2))
    _roll(poses, (first, second), (math.sqrt(squares[0]), math.sqrt(squares[1])), way, ahead, draws)


def move_omnidirectional(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """As `move_differential`, for a base that drives sideways too: amcl's OmniMotionModel."""
    dx, dy = after.x - before.x, after.y - before.y
    way, turn = math.hypot(dx, dy), normalize_angle(after.yaw - before.yaw)
    a1, a2, a3, a4, a5 = alphas
    along = math.sqrt(a3 * way**2 + a1 * turn**2)
    around = math.sqrt(a4 * turn**2 + a2 * way**2)
    aside = math.sqrt(a1 * turn**2 + a5 * way**2)
    bearing = (math.atan2(dy, dx) - before.yaw if way > 0.0 else 0.0) + poses[:, 2]
    cos, sin = np.cos(bearing), np.sin(bearing)
    forward, left = way + along * draws[:, 0], aside * draws[:, 1]
    poses[:, 0] += forward * cos + left * sin
    poses[:, 1] += forward * sin - left * cos
    poses[:, 2] += turn + around * draws[:, 2]


def kld_limits(least: int, most: int, error: float, quantile: float) -> NDArray[np.int64]:
    """Particles that are enough for a histogram with k bins, for k from 0 to `most` (Fox 2003; amcl's formula).

    With them the error of the distribution is below `error` in the share of cases of which `quantile` is the upper
    standard normal quantile.
    """
    k = np.maximum(np.arange(most + 1), 2) - 1.0
    b = 2.0 / (9.0 * k)
    cube = (1.0 - b + np.sqrt(b) * quantile) ** 3
    enough = np.clip(np.ceil(k / (2.0 * error) * cube), least, most).astype(np.int64)
    enough[:2] = most
    return enough


@compiled
def make_table(count: int) -> Bins:
    """An empty hash table for the bins of up to `count` particles."""
    room = 4
    while room < 2 * count:
        room *= 2
    return np.full(room, EMPTY)


@compiled
def find_bin(table: Bins, key: int) -> int:
    """The row of a bin in the table: its own, or the empty one where it belongs."""
    mask = table.shape[0] - 1
    row = ((key >> 34) * 73856093 ^ (key >> 6) * 19349663 ^ key * 83492791) & mask
    while table[row] != EMPTY and table[row] != key:
        row = (row + 1) & mask
    return int(row)


@compiled
def bin_of(x: float, y: float, yaw: float, size: tuple[float, float, float]) -> int:
    """The bin of a particle as one number: of steps along x, along y, and of its heading from 0 to a full turn."""
    turn = yaw - 2.0 * math.pi * math.floor(yaw / (2.0 * math.pi))
    return math.floor(x / size[0]) * STEP_X + math.floor(y / size[1]) * STEP_Y + math.floor(turn / size[2])


def bins_of(poses: Floats, size: tuple[float, float, float]) -> Bins:
    """`bin_of` for many particles: (n, 3) to (n)."""
    turns = poses[:, 2] - 2.0 * math.pi * np.floor(poses[:, 2] / (2.0 * math.pi))
    x, y, turn = np.floor(np.stack((poses[:, 0], poses[:, 1], turns)) / np.reshape(size, (3, 1))).astype(np.int64)
    return np.asarray(x * STEP_X + y * STEP_Y + turn)


def _resample_numpy(
    poses: Floats, sums: Floats, draws: Floats, strangers: Floats, mixing: Floats, share: float,
    enough: NDArray[np.int64], size: tuple[float, float, float], out: Floats,
) -> int:  # fmt: skip
    """The same without numba."""
    out[:] = poses[np.minimum(np.searchsorted(sums, draws, side="right"), len(poses) - 1)]
    if share > 0.0:
        out[mixing < share] = strangers[mixing < share]
    first = np.unique(bins_of(out, size), return_index=True)[1]
    is_new = np.zeros(len(out), np.int64)
    is_new[first] = 1
    done = np.arange(1, len(out) + 1) >= enough[np.minimum(np.cumsum(is_new), len(enough) - 1)]
    return int(done.argmax()) + 1 if done.any() else len(out)


@plainly(_resample_numpy)
@compiled
def resample(
    poses: Floats, sums: Floats, draws: Floats, strangers: Floats, mixing: Floats, share: float,
    enough: NDArray[np.int64], size: tuple[float, float, float], out: Floats,
) -> int:  # fmt: skip
    """Draw particles from `poses` (n, 3) into `out` (m, 3) until there are `enough` for their bins; return how many.

    `sums` (n) are the running sums of the weights, up to 1, and `draws` (m) uniform numbers: they say which particles.
    With a `share` above 0, a row of `strangers` (m, 3) comes instead where the number in `mixing` (m) is below it.
    """
    table = make_table(out.shape[0])
    bins, count = 0, poses.shape[0]
    # For each n-th part of the range of draws the first particle that it may mean: a search needs two steps from there.
    guide = np.empty(count, np.int64)
    place = 0
    for k in range(count):
        while place < count - 1 and sums[place] * count <= k:
            place += 1
        guide[k] = place
    for i in range(out.shape[0]):
        if share > 0.0 and mixing[i] < share:
            out[i, 0], out[i, 1], out[i, 2] = strangers[i, 0], strangers[i, 1], strangers[i, 2]
        else:
            draw = draws[i]
            low = guide[min(int(draw * count), count - 1)]
            while low > 0 and sums[low - 1] > draw:
                low -= 1
            while low < count - 1 and sums[low] <= draw:
                low += 1
            out[i, 0], out[i, 1], out[i, 2] = poses[low, 0], poses[low, 1], poses[low, 2]
        key = bin_of(out[i, 0], out[i, 1], out[i, 2], size)
        row = find_bin(table, key)
        if table[row] == EMPTY:
            table[row] = key
            bins += 1
        if i + 1 >= enough[min(bins, enough.shape[0] - 1)]:
            return i + 1
    return int(out.shape[0])


def spread_poses(frame: Frame, free: NDArray[np.int64], draws: Floats) -> Floats:
    """Poses (n, 3) in `map` all over the cells `free` (indexes), from uniform `draws` (n, 4). Raises ValueError."""
    if not len(free):
        raise ValueError("the map has no free cells: a robot can be nowhere on it")
    row, column = np.divmod(free[(draws[:, 0] * len(free)).astype(np.int64)], frame.columns)
    places = frame.points_from_cells(np.stack((column + draws[:, 1], row + draws[:, 2]), axis=1))
    return np.column_stack((places, 2.0 * math.pi * draws[:, 3] - math.pi))
