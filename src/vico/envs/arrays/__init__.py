"""The array form: observations and actions as arrays of fixed shape, for learners."""
