"""How what is found in a picture becomes one vector: pooling, projection, unit length."""

__all__: list[str] = []
