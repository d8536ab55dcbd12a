"""Trials of a behaviour: awkward views and small worlds, and what it does wrong in them, in words for its author."""
