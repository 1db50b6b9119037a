"""What people do: stand, sit, hold and put things, pass doors, ride, hear and learn of events."""
