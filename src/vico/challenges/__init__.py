"""What is asked and how it is judged: one folder a challenge, one runner, one results table."""
