"""Parameters of the localiser."""

from typing import NamedTuple


class AmclOptions(NamedTuple):
    """Parameters, with amcl's names and Nav2's defaults."""

    alpha1: float = 0.2
    alpha2: float = 0.2
    alpha3: float = 0.2
    alpha4: float = 0.2
    alpha5: float = 0.2
    max_beams: int = 60
    min_particles: int = 500
    max_particles: int = 2000
    update_min_d: float = 0.25
    update_min_a: float = 0.2
    z_hit: float = 0.5
    z_rand: float = 0.5
    sigma_hit: float = 0.2
    laser_likelihood_max_dist: float = 2.0
    laser_max_range: float = 100.0
    """Metres; a longer beam, or one of the laser's range_max, says nothing."""
    pf_err: float = 0.05
    pf_z: float = 0.99
    recovery_alpha_slow: float = 0.0
    recovery_alpha_fast: float = 0.0
    resample_interval: int = 1
    robot_model_type: str = "nav2_amcl::DifferentialMotionModel"
    """Or nav2_amcl::OmniMotionModel."""
    matched_share: float = 0.15
    """Share of the particles that are put where the scan fits best, near the heaviest one; 0 is plain amcl, which takes
    many updates to follow a turn that odometry did not see."""
    global_particles: int = 25_000
    """Poses that are tried with each scan while the robot may be anywhere."""
    teammate_margin: float = 0.1
    """Metres around a teammate in which a beam that ends there counts as on the teammate, and is left out."""


def check_options(options: AmclOptions) -> None:
    """Raise ValueError for options that cannot work."""
    if not 1 <= options.min_particles <= options.max_particles:
        raise ValueError(
            f"min_particles {options.min_particles} and max_particles {options.max_particles}: "
            "give two numbers from 1 on, the first one not above the second"
        )
    if options.max_beams < 1 or options.resample_interval < 1:
        raise ValueError("max_beams and resample_interval are whole numbers from 1 on")
    if not (options.sigma_hit > 0.0 and options.laser_likelihood_max_dist > 0.0 and options.pf_err > 0.0):
        raise ValueError("sigma_hit, laser_likelihood_max_dist and pf_err are above 0")
    if options.robot_model_type.rpartition("::")[2] not in ("DifferentialMotionModel", "OmniMotionModel"):
        raise ValueError(
            f"robot_model_type {options.robot_model_type!r}: give nav2_amcl::DifferentialMotionModel or "
            "nav2_amcl::OmniMotionModel"
        )


def alphas_of(options: AmclOptions) -> tuple[float, ...]:
    """alpha1 to alpha5."""
    return options.alpha1, options.alpha2, options.alpha3, options.alpha4, options.alpha5
