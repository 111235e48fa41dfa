"""report.json and what `inspect` prints: what they hold, and their words."""
