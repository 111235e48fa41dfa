"""How good a frame is: probes, the evidence that they give, and which tiles are traced for it."""
