"""Pick and place: a mobile manipulator takes the thing that it is told of, and puts it down where it is told to."""
