"""Fluoroscopy: a biplane DICOM XA run -> `Acquisition`."""

from .pairing import read_biplane

__all__ = ["read_biplane"]
