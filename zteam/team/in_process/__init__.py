"""A whole team in one process, on a bus in memory: the same nodes and messages as with one process each."""
