"""The map server: a map without a simulator."""
