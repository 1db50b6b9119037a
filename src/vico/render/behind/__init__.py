"""What lies behind glass: rooms seen from the street."""
