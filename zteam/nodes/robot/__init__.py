"""The robot process."""
