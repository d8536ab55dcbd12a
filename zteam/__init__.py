"""zteam: a team of robots as separate processes linked by Zenoh."""

__version__ = "0.1.0"
