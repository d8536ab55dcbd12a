"""Recordings of runs: MCAP files that other programs open, and that zteam runs again, compares and replays."""
