"""How pictures are prepared for networks, as the program of each had them."""

__all__: list[str] = []
