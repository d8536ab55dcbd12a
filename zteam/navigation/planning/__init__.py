"""Navigation without a bus; its public names are in `zteam.planning`."""
