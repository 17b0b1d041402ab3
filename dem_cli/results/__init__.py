"""Result files: names and units (`schema`), the writer and the reader."""

from dem_cli.results.body_frames import StoredBodyFrame
from dem_cli.results.body_reader import BodyResults
from dem_cli.results.body_writer import ImpulseWriter
from dem_cli.results.dissipation import Dissipation
from dem_cli.results.files import partial_path
from dem_cli.results.frames import StoredFrame, StoredIncrement
from dem_cli.results.motions import StoredMotion
from dem_cli.results.reader import Results, Surface, Tracks, open_results
from dem_cli.results.stages import Stage
from dem_cli.results.writer import ResultWriter

__all__ = [
    "BodyResults",
    "Dissipation",
    "ImpulseWriter",
    "ResultWriter",
    "Results",
    "Stage",
    "StoredBodyFrame",
    "StoredFrame",
    "StoredIncrement",
    "StoredMotion",
    "Surface",
    "Tracks",
    "open_results",
    "partial_path",
]
