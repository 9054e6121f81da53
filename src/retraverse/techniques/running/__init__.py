"""How networks are run: weights, batches, PyTorch and ONNX Runtime, 8-bit integers."""

__all__: list[str] = []
