"""One run of Blender in a process of its own.

It takes a `Job` (a .blend, settings, a command, the files to be made) and gives the command's report, with the files in
the output folder, all of them or none; events go to the caller meanwhile. Start reading at `run_worker` in
`supervisor`.
"""
