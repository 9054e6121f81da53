"""What is measured of pictures themselves: JPEG's parts, legibility, quantisation tables."""

__all__: list[str] = []
