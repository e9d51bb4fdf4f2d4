"""From stored numbers to light: larger means more X-rays, in proportion where that is known.

What finds the device judges how much light it absorbs, as a share. That is right for pixels in
proportion to the beam's intensity (LIN), so that others are brought there first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereosom_plugin.acquisition import Image

from .header import Header, label


@dataclass(frozen=True, eq=False)
class Light:
    """How stored numbers become light.

    Parameters
    ----------
    lowest, highest : int
        What can be stored.
    inverted : bool
        Whether larger stored numbers mean less light.
    slope, intercept : float
        Of the rescaling.
    table : (n,) array, optional
        Light for the numbers from `first` on; beyond its ends, its ends.
    first : int
    logarithmic : bool
        Whether the range of numbers holds the logarithm of the light, from nothing to all.
    """

    lowest: int
    highest: int
    inverted: bool = False
    slope: float = 1.0
    intercept: float = 0.0
    table: npt.NDArray[np.float32] | None = None
    first: int = 0
    logarithmic: bool = False

    def __call__(self, stored: Image) -> Image:
        """Turn a stored picture, (rows, columns), into light; integers stay integers.

        Examples
        --------
        >>> Light(0, 4095, inverted=True)(np.array([[0, 4000]]))
        array([[4095,   95]])
        >>> light = Light(0, 4095, logarithmic=True)(np.array([[0, 4095]]))
        >>> light.round().astype(int).tolist()
        [[0, 4095]]
        """
        values = stored
        if self.table is not None:
            place = np.clip(stored.astype(np.int64) - self.first, 0, len(self.table) - 1)
            values = self.table[place]
            return self.table.max() - values if self.inverted else values
        low, high = self.lowest, self.highest
        if (self.slope, self.intercept) != (1.0, 0.0):
            scaled = stored.astype(np.float32) * np.float32(self.slope)
            values = scaled + np.float32(self.intercept)
            ends = sorted(self.slope * end + self.intercept for end in (low, high))
            if self.inverted:
                values = np.float32(ends[0] + ends[1]) - values
            return values
        if self.inverted:
            # In unsigned numbers, low is 0 and in signed ones low + high is -1: both fit.
            values = ~stored if low < 0 else stored.dtype.type(high) - stored
        if self.logarithmic:
            share = (values.astype(np.float32) - low) / (high - low)
            values = np.expm1(share * np.float32(np.log(high - low + 1.0)))
        return values


def read_light(header: Header, stored_bits: int, signed: bool) -> tuple[Light, list[str]]:
    """Read what stored numbers mean; the header is that of a frame.

    Returns
    -------
    light : Light
    notes : list of str
        What was assumed.

    Raises
    ------
    InputError
        Where a table or a number cannot be used.
    """
    notes: list[str] = []
    low, high = (-(1 << stored_bits - 1), (1 << stored_bits - 1) - 1) if signed else (
        0, (1 << stored_bits) - 1)  # fmt: skip
    relationship = header.text("PixelIntensityRelationship").upper()
    sign = header.number("PixelIntensityRelationshipSign")
    if sign not in (None, 1, -1):
        raise header.refuse(
            f"{label('PixelIntensityRelationshipSign')} is {sign:g}, must be 1 or -1",
            "correct the object",
        )
    inverted = header.text("PhotometricInterpretation").upper() == "MONOCHROME1"
    if sign is not None:  # it says what MONOCHROME1 only suggests
        inverted = sign < 0
    if relationship != "LIN" and (found := _to_linear(header)) is not None:
        table, first = found
        rises = bool(table[-1] >= table[0])
        return Light(low, high, rises == inverted, table=table, first=first), notes
    slope, intercept = header.number("RescaleSlope"), header.number("RescaleIntercept")
    if slope == 0:
        raise header.refuse(f"{label('RescaleSlope')} is 0", "correct the object")
    slope, intercept = (1.0 if slope is None else slope), intercept or 0.0
    if sign is not None:  # it speaks of the stored numbers themselves
        slope, intercept = 1.0, 0.0
    if relationship == "LOG":
        notes.append(
            f"pixels hold the logarithm of the light ({label('PixelIntensityRelationship')} LOG) "
            "without a table to undo it; they are taken to span it from 1 to all that fits"
        )
        return Light(low, high, inverted, logarithmic=True), notes
    if relationship == "DISP":
        notes.append(
            f"pixels are meant for display ({label('PixelIntensityRelationship')} DISP); "
            "they are taken to be in proportion to the light"
        )
    elif relationship != "LIN":
        said = f"is {relationship[:16]!r}" if relationship else "is absent"
        notes.append(
            f"{label('PixelIntensityRelationship')} {said}; pixels are taken to be in "
            "proportion to the light"
        )
    return Light(low, high, inverted, slope, intercept), notes


def _to_linear(header: Header) -> tuple[npt.NDArray[np.float32], int] | None:
    """The table that undoes what was done to the light, and the number it begins with."""
    for keyword in ("PixelIntensityRelationshipLUTSequence", "ModalityLUTSequence"):
        for item in header.items(keyword):
            if item.text("LUTFunction").upper() not in ("", "TO_LINEAR"):
                continue
            descriptor = item.numbers("LUTDescriptor")
            data = item.value("LUTData")
            if isinstance(data, bytes):
                values = np.frombuffer(data[: len(data) // 2 * 2], "<u2").astype(np.float32)
            else:
                values = np.array(item.numbers("LUTData"), dtype=np.float32)
            entries = (int(descriptor[0]) or 65536) if len(descriptor) == 3 else -1
            if entries < 2 or len(values) < entries:
                raise header.refuse(f"the table in {label(keyword)} is torn", "export it again")
            return values[:entries], int(descriptor[1])
    return None
