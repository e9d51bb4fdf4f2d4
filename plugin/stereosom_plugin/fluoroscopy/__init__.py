"""Fluoroscopy: a biplane DICOM XA run -> `Acquisition`."""

from .describe import describe_biplane, description_text
from .pairing import read_biplane

__all__ = ["describe_biplane", "description_text", "read_biplane"]
