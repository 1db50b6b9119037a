"""The version of Virtual Community, written here and nowhere else."""

__version__ = "0.2.0"
