"""How a stereo pair is handed over: the layouts of one picture, their names and their marks in movies."""
