"""Places: shops, homes, offices and the doors they are entered by."""
