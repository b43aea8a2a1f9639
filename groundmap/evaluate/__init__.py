"""Held-out evaluation: maps of one part of a log are judged by the other part."""

from groundmap.evaluate.protocols import Verdict, evaluate

__all__ = ["Verdict", "evaluate"]
