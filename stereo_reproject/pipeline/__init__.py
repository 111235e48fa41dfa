"""The way of a frame, in `frame`: start there. Around it: view layers, costs, and what a pair will take."""
