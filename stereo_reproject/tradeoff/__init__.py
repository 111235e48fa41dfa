"""What accuracy costs: the runs of a price list, and charts, for which the command line needs matplotlib."""
