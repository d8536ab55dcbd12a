"""Navigation of robots as one process: localiser, costmaps, planner, controller and recovery of each (`zteam-nav`)."""
