"""Timetables: zipped GTFS feeds, cut to a window."""
