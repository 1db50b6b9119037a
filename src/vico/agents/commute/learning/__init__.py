"""Learning to commute: an abstract city to train in, what a policy sees, and trained policies."""
