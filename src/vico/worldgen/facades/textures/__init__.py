"""Procedural textures of facades and grounds, painted by bay and storey."""
