"""What `zteam bench` runs: figures of this machine, never judged by a test."""
