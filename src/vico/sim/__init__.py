"""The simulation: loop, state, people, robots, physics, traffic, transit, observations, pictures and recordings."""
