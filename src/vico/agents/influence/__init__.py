"""Who takes part in the influence challenge: main agents that court members, and the members themselves."""
