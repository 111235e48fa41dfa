"""Tracing of single pixels: requests for them, the cheapest way to answer, packed pictures, and the pixel filter."""
