"""Results as DICOM, beside the run that they were made of: centerlines as SR, masks as SEG."""

from .centerlines import write_centerlines
from .masks import write_masks
from .source import Origin, read_origin

__all__ = ["Origin", "read_origin", "write_centerlines", "write_masks"]
