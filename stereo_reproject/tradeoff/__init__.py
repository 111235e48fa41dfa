"""The cost of accuracy: the cases of a price list, and its charts, for which the command line needs matplotlib."""
