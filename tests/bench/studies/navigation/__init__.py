"""What the study `nav` measures: planning, costmaps and localisation, in one process and without a bus."""
