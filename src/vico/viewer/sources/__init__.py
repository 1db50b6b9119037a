"""Where the viewer's frames come from: a run folder, or a simulation that goes on; both give the same."""
