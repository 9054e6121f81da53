"""How a study is done: runs become tasks, in an order, for workers here or elsewhere."""

__all__: list[str] = []
