"""One file a process, and what every process shares."""
