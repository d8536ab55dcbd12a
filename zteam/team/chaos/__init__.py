"""Faults on purpose: at chosen moments of a running team, and a report of how it recovers."""
