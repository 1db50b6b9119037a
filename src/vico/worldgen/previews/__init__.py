"""Pictures of a finished world: its map, and views at eye height."""
