"""For hands: the `vico` command, one module a verb."""
