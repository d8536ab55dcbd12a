"""Where most particles are: those in bins that touch are one cluster, and the heaviest cluster is the estimate."""

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.kernels.binding import Floats, find_cluster
from zteam.planning.particles import BIN_SIZE

_BINS_OF_TURN = 36


def estimate_pose(poses: Floats, weights: Floats) -> tuple[Pose2, NDArray[np.float64]]:
    """The mean and covariance (3, 3) of the heaviest cluster of particles (n, 3)."""
    _, moments, about = find_cluster(poses, weights, BIN_SIZE, _BINS_OF_TURN)
    moments /= moments[0, 0]
    mean = moments[0, 1:]
    x, y, yaw = (about + mean).tolist()
    return Pose2(x, y, normalize_angle(yaw)), moments[1:, 1:] - np.outer(mean, mean)
