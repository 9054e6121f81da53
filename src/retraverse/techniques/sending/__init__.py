"""How descriptors travel in fewer bytes: what a robot may send in place of its pictures."""

from retraverse.techniques.sending.base import Coder, Coding, received
from retraverse.techniques.sending.choice import CODINGS, coding, coding_label

__all__ = ["CODINGS", "Coder", "Coding", "coding", "coding_label", "received"]
