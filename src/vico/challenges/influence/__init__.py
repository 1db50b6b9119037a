"""The influence challenge: two main agents court the members of a community for a day."""
