"""The TF aggregator process."""
