"""Teams made into processes: started at once, watched, stopped in order."""
