"""Datasets of demonstrations: recorded runs, or episodes played for the purpose, in formats that trainers read.

`vico.datasets.build` makes one, `vico.datasets.folder` opens it, `vico.datasets.vectors` and `vico.datasets.vectors`
turn observations and actions into vectors and back, for whoever trains on it and acts after it. See docs/datasets.md.
"""
