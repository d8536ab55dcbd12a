"""Tests of whole teams: the `team` fixture of the pytest plugin, and what it is made of."""
