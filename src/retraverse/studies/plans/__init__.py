"""What a study runs: plans as values, their TOML files, and what can be wrong with them."""

__all__: list[str] = []
