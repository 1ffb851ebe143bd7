"""Asperity renders touch: a stylus moves, a model predicts the vibration, an actuator plays it.

`Graph` reads a graph or a scene, `Graph.render` runs it over a stroke, and `Graph.engine` runs it step by
step. `node` makes a Python class a kind of node. `invert` turns magnitudes into a signal, and `compare` ranks
the ways to do so. Arrays are NumPy's. Errors are `Error`; its text has file, line, column and a caret.
"""

from . import accuracy
from ._asperity import AsperityWarning, Engine, Error, version
from ._functions import ArTexture, Material, choose, fit_ar, materials, study_log, tradeoff
from ._graph import Felt, Graph, Signal, render
from ._node import Port, Setup, Tick, node
from ._phase import Comparison, compare, invert

__version__ = version()

__all__ = [
    "ArTexture",
    "AsperityWarning",
    "Comparison",
    "Engine",
    "Error",
    "Felt",
    "Graph",
    "Material",
    "Port",
    "Setup",
    "Signal",
    "Tick",
    "accuracy",
    "choose",
    "compare",
    "fit_ar",
    "invert",
    "materials",
    "node",
    "render",
    "study_log",
    "tradeoff",
]
