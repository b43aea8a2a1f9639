"""Readers and writers of files: logs of views and maps."""

from groundmap.io.export import EXPORTERS, export, files_written
from groundmap.io.folder_writer import write_views
from groundmap.io.formats import FORMATS, read_views
from groundmap.io.load import LOADERS, files_of, load_map
from groundmap.io.log import ViewLog
from groundmap.io.map_images import grid_of

__all__ = [
    "EXPORTERS",
    "FORMATS",
    "LOADERS",
    "ViewLog",
    "export",
    "files_of",
    "files_written",
    "grid_of",
    "load_map",
    "read_views",
    "write_views",
]
