"""Starts the processes of a team at once, watches them, and stops them in order."""
