"""What is wrong with a team, and what to do about it: pure checks over facts that were collected from the bus."""
