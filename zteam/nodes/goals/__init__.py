"""Goals from a file: robots reach them in turn, and all robots at the same time."""
