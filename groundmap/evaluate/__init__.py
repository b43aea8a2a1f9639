"""Held-out evaluation: a part of a log is mapped, the rest judges the map."""

from groundmap.evaluate.protocols import Verdict, evaluate

__all__ = ["Verdict", "evaluate"]
