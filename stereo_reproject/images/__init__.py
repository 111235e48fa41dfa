"""Renders as arrays: passes by name, EXR in and out, lookup, filters, tone and error."""
