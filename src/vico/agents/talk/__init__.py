"""What residents remember, what can be asked of them, how they answer, and how answers are understood."""
