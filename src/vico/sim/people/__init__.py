"""People in a simulation: they stand, sit, hold and put objects, pass doors, ride, hear and learn of events."""
