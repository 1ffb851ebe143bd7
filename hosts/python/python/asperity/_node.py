"""Nodes that are Python classes."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, Union

from . import _asperity

PortSpec = Union[str, "tuple[str, int]", "tuple[str, int, str]"]
"""``"frames"``, ``"spectrum"``, ``"audio"``, ``"control"``, or ``("control", 3, "mm")``."""

T = TypeVar("T")


@dataclass(frozen=True)
class Port:
    """A port of a node in its graph, as `prepare` sees it."""

    shape: str
    """``"frames"`` (magnitudes), ``"spectrum"``, ``"audio"`` or ``"control"``."""
    rate: int
    """Samples a second of the signal; ticks a second for a control."""
    size: int
    """Bins of a frame, values of a control, 1 for audio."""
    length: int
    """Samples of the window of a frame; else 0."""
    frame_rate: float
    """Frames a second; else 0."""
    unit: str
    """Unit of the values."""


@dataclass(frozen=True)
class Setup:
    """Place of a node in its graph, for `prepare`."""

    id: str
    """The node's name in the graph."""
    tick_hz: int
    """Ticks a second."""
    audio_hz: int
    """Audio rate of the graph in Hz."""
    seed: int
    """Seed of this node for random numbers."""
    inputs: dict[str, Port]
    """Inputs by name."""
    outputs: dict[str, Port]
    """Outputs by name."""


class Tick:
    """One call of a node. The arrays stay the same from tick to tick, and their values change.

    An input of frames is None in a tick without a frame. An output of frames is None then too; otherwise it
    goes out with the number of the frame that came in. An output of audio is zero until it is written.
    """

    __slots__ = ("frame", "index", "inputs", "outputs", "start")

    index: int
    """Number of the tick, from 0."""
    frame: int | None
    """Number of the frame in this tick."""
    start: int | None
    """First sample of that frame."""
    inputs: dict[str, Any]
    """Arrays by name."""
    outputs: dict[str, Any]
    """Arrays by name, to be written, as in ``tick.outputs["signal"][:] = y``."""

    def __init__(self, inputs: dict[str, Any], outputs: dict[str, Any]) -> None:
        self.index = 0
        self.frame = self.start = None
        self.inputs, self.outputs = inputs, outputs


def node(
    *,
    inputs: Mapping[str, PortSpec] | None = None,
    outputs: Mapping[str, PortSpec] | None = None,
    params: Mapping[str, bool | int | float | str] | None = None,
    name: str | None = None,
    latency_ms: float = 0.0,
) -> Callable[[type[T]], type[T]]:
    """Make a class a kind of node.

    The class has a method ``process(self, tick)``, which is called once a tick with a `Tick`. It may have
    ``prepare(self, setup)``, which is called before with a `Setup`. When the node begins anew, a new object
    is made. An exception is a failure of the node: this tick's output fades or holds, and the graph goes on.

    Parameters
    ----------
    inputs, outputs
        Ports by name: ``"frames"`` (magnitudes, as amplitudes), ``"spectrum"`` (complex), ``"audio"``, or
        ``"control"``, also as ``("control", 3, "mm")`` with the number of values and their unit. Frames and
        audio that come in give their layout, rate and unit to those that go out.
    params
        Parameters with their defaults. A graph sets them, and the object has them as attributes.
    name
        Name of the kind in a graph. By default that of the class: ``MyPhase`` is ``my_phase``.
    latency_ms
        Time by which the output is late, so that others can take it into account.

    Examples
    --------
    >>> @node(inputs={"magnitude": "frames"}, outputs={"spectrum": "spectrum"})
    ... class ZeroPhase:
    ...     def process(self, tick):
    ...         if tick.frame is not None:
    ...             tick.outputs["spectrum"][:] = tick.inputs["magnitude"]
    """

    def declare(cls: type[T]) -> type[T]:
        kind = name or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()
        summary = (cls.__doc__ or f"The Python class {cls.__qualname__}.").strip().splitlines()[0]
        made = _asperity.Kind(
            cls,
            (Port, Setup, Tick),
            kind,
            summary,
            [_declared(*port) for port in (inputs or {}).items()],
            [_declared(*port) for port in (outputs or {}).items()],
            list((params or {}).items()),
            latency_ms,
        )
        setattr(cls, _KIND, made)
        return cls

    return declare


_KIND = "__asperity_kind__"


def _declared(name: str, spec: PortSpec) -> tuple[str, str, int, str | None]:
    shape, count, unit = (spec, 1, "1") if isinstance(spec, str) else (*spec, "1")[:3]
    return (name, shape, count, unit) if shape == "control" else (name, shape, 1, None)


def kind_of(cls: type) -> _asperity.Kind:
    """The kind that `node` made of a class."""
    kind = cls.__dict__.get(_KIND)
    if not isinstance(kind, _asperity.Kind):
        raise TypeError(f"{cls.__qualname__} is no kind of node: write @asperity.node(...) above it")
    return kind


def kinds_of(classes: Sequence[type]) -> list[_asperity.Kind]:
    """The kinds of classes, each once."""
    return [kind_of(cls) for cls in dict.fromkeys(classes)]
