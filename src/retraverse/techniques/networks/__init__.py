"""Networks, one file each: plain PyTorch modules, imported only where one is run or trained."""

__all__: list[str] = []
