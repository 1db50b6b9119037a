"""Sources of the viewer's frames: a run folder, or a simulation that goes on; both give the same."""
