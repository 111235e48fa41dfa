"""The programs that are started by name: command line, worker, writer, heartbeat.

They take arguments or lines of JSON, and call the rooms below. They import Blender inside functions alone, so that the
process that talks to the user never loads it. Start reading at `main` in `cli`.
"""
