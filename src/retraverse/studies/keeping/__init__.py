"""What a study keeps: records, descriptions and matrices by content, one writer at a time."""

__all__: list[str] = []
