"""One run in a process of its own: the job, its supervisor, the worker process, its private folder, progress."""
