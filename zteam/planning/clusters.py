"""Where most particles are: those in bins that touch are one cluster, and the heaviest cluster is the estimate."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.kernels.binding import Floats, label_clusters
from zteam.planning.particles import BIN_SIZE, bins_of

_BINS_OF_TURN = 36


def estimate_pose(poses: Floats, weights: Floats) -> tuple[Pose2, NDArray[np.float64]]:
    """The mean and covariance (3, 3) of the heaviest cluster of particles (n, 3)."""
    labels, clusters = label_clusters(bins_of(poses, BIN_SIZE), _BINS_OF_TURN)
    if clusters > 1:
        chosen = labels == np.bincount(labels, weights, clusters).argmax()
        poses, weights = poses[chosen], weights[chosen]
    # A cluster lies about one of its particles, so its sums stay small, and so do its turns.
    about = poses[weights.argmax()]
    offsets, shares = poses - about, weights / weights.sum()
    offsets[:, 2] -= 2.0 * math.pi * np.rint(offsets[:, 2] * (0.5 / math.pi))
    mean = shares @ offsets
    x, y, yaw = (about + mean).tolist()
    offsets -= mean
    return Pose2(x, y, normalize_angle(yaw)), (offsets.T * shares) @ offsets
