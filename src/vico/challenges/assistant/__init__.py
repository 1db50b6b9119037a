"""The community assistant tasks: help people with carrying, delivering and finding things (paper, section 4.1)."""
