"""Many frames: which are to be rendered, the journal, the runs that work on it, the writer, the report."""
