"""Tables of results: means and differences with intervals, the paper's rows beside them, and the leaderboard."""
