"""What techniques without a network compute: gradients, filters, entropy."""

__all__: list[str] = []
