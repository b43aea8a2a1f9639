"""Files: logs of views in, logs of views and maps for other programs out."""

from groundmap.io.export import EXPORTERS, export
from groundmap.io.folder_writer import write_views
from groundmap.io.formats import FORMATS, read_views
from groundmap.io.log import ViewLog

__all__ = ["EXPORTERS", "FORMATS", "ViewLog", "export", "read_views", "write_views"]
