"""What happens: the clock, the loop, avatars, robots, traffic, transit, observations and recordings."""
