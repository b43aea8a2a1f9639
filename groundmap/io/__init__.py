"""Readers and writers of files: logs of views and maps."""

from groundmap.io.alignment import AlignedViews, ScalePoints, align
from groundmap.io.export import EXPORTERS, export, files_written
from groundmap.io.folder_writer import write_views
from groundmap.io.formats import FORMATS, read_views
from groundmap.io.load import LOADERS, files_of, load_map
from groundmap.io.log import ViewLog
from groundmap.io.map_images import grid_of
from groundmap.io.readers.base import SparseMapLog
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

__all__ = [
    "AlignedViews",
    "Camera",
    "EXPORTERS",
    "FORMATS",
    "LOADERS",
    "ScalePoints",
    "SparseMap",
    "SparseMapLog",
    "ViewLog",
    "align",
    "export",
    "files_of",
    "files_written",
    "grid_of",
    "load_map",
    "read_views",
    "write_views",
]
