"""What starts by name: command line, worker, writer, heartbeat. They alone reach up, inside of functions."""
