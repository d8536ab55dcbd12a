"""The main job for a long time: `zteam bench study` runs teams from many seeds, each in one process."""
