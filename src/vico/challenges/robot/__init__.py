"""Community robot: a mobile manipulator and a carrier bring things, and go along with people, by real contact."""
