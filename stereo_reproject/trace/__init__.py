"""How pixels are traced: which way is the cheapest, how they are packed, and how samples lie in a pixel."""
