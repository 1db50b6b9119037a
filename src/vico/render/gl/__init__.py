"""The same pictures by OpenGL: of the same scene arrays, for machines with a graphics card (extra ``gl``)."""
