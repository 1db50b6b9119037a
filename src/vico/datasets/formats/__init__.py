"""Formats of datasets on the disk: one module a format."""
