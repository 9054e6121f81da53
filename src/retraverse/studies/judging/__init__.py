"""What records say: selection rules, expectations, what is saved at equal accuracy."""

__all__: list[str] = []
