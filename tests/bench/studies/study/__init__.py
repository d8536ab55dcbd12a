"""The main job for a long time: the study `lines` runs teams from many seeds, each in one process."""
