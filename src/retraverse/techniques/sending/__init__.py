"""How descriptors travel in fewer bytes: what a robot may send in place of its pictures."""

from retraverse.techniques.sending.base import Coder, Coding, Received, received, sent_bytes
from retraverse.techniques.sending.choice import CODINGS, coding, coding_label

__all__ = [
    "CODINGS",
    "Coder",
    "Coding",
    "Received",
    "coding",
    "coding_label",
    "received",
    "sent_bytes",
]
