"""Result files: names and units (`schema`), the writer and the reader."""

from dem_cli.results.motions import StoredMotion
from dem_cli.results.reader import Results, Stage, StoredFrame, Surface, Tracks, open_results
from dem_cli.results.writer import ResultWriter, partial_path

__all__ = [
    "ResultWriter",
    "Results",
    "Stage",
    "StoredFrame",
    "StoredMotion",
    "Surface",
    "Tracks",
    "open_results",
    "partial_path",
]
