"""Commands: one file each; heavy imports inside the command."""
