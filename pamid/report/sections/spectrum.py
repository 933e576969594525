"""The residual by frequency."""

from typing import Any, ClassVar

from ...errors import ShortTrajectoryError
from ..drawings.spectrum import spectrum_figure, worse_bands
from ..drawings.windows import equations
from ..quantities import cell
from .base import Picture, Section


class SpectrumSection(Section):
    """The spectrum of the residual and the bands that hold the gap."""

    name: ClassVar[str] = "spectrum"
    title: ClassVar[str] = "The error by frequency"
    rank: ClassVar[int] = 50

    def shown(self) -> bool:
        """Whether there are windows."""
        return bool(equations(self.diagnosis))

    def content(self) -> dict[str, Any]:
        """Return the spectrum and the bands."""
        d = self.diagnosis
        name = equations(d)[0]
        pictures: list[Picture] = []
        try:
            caption = f"Spectrum of the {self.words.residual_words(name)}."
            pictures.append(self.picture(spectrum_figure(d, name), name, caption))
            worse = worse_bands(d, name) if d.added else []
        except ShortTrajectoryError:
            worse = []  # a log of very short runs has no spectrum
        bands = [
            {
                "equation": b.equation,
                "band": f"{b.from_hz:.3g} to {b.to_hz:.3g} Hz",
                "share": b.share,
                "text": cell(b.share),
            }
            for b in d.bands
            if b.equation == name
        ]
        return {
            "pictures": pictures,
            "bands": bands if d.gap else [],
            "worse": [f"from {a:.3g} to {b:.3g} Hz ({k:.2g} times)" for a, b, k in worse],
        }
