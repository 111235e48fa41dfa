"""What starts by name: command line, worker, writer, heartbeat. They import Blender in functions alone."""
