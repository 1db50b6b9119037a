"""Conversation of residents: their memory, questions to them, their answers, and the reading of answers."""
