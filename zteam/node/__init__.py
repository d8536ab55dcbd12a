"""What every process shares: its node, its part in lock-step, its logs and its orderly end."""
